//! A network from a file that anybody may have written.

use crate::about::{self, About};
use crate::{INPUT, OUTPUT, wire};
use policy::network::{OUTPUTS, Prediction};
use rten::{DataType, Dimension, Model, NodeId, RunOptions, ThreadPool, Value, ValueType};
use sim::limits::{ONNX_BATCH_MAX, ONNX_BYTES_MAX};
use sim::sensing::{GRID_CELLS, OccupancyGrid};
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use storage::{FileError, read, sums};

const EXPORT: &str = "write it again, as docs/formats.md shows under \"Networks of others: ONNX\"";

/// Grids that are answered in one call where the file leaves that open. Always as many: with another number, a runtime may add
/// in another order, and the answer for one car would depend on how many others are still driving. One: nothing is computed
/// in vain when few cars are left, and rten takes hardly longer for each grid than in larger batches.
const BATCH: usize = 1;

/// Cells of a grid.
const CELLS: usize = GRID_CELLS * GRID_CELLS;

/// A network that is checked and answers.
#[derive(Clone)]
pub struct OnnxNetwork {
    model: Arc<Model>,
    input: NodeId,
    output: NodeId,
    batch: usize,
    /// Numbers of an answer: (u, w), or these and both raw log-variances.
    numbers: usize,
    about: Option<About>,
    sha256: String,
}

impl fmt::Debug for OnnxNetwork {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { batch, numbers, sha256, .. } = self;
        write!(f, "OnnxNetwork {{ batch: {batch}, numbers: {numbers}, sha256: {sha256:?} }}")
    }
}

impl OnnxNetwork {
    /// Reads a file and lets it answer once.
    ///
    /// # Errors
    /// If it cannot be read, is larger than [`ONNX_BYTES_MAX`], is not an ONNX file, uses what the runtime does not
    /// know, or its input or output is not what docs/formats.md says.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let bytes = read::bytes(path, ONNX_BYTES_MAX)
            .map_err(|error| FileError::unreadable(path, &error, "name an ONNX file"))?;
        let refused = |problem: String| FileError::new(path, problem, EXPORT);
        // The runtime refuses what it knows to be wrong and panics at some of the rest.
        let loaded = catch_unwind(AssertUnwindSafe(|| Self::from_bytes(bytes)));
        loaded.unwrap_or_else(|_| Err("is damaged: the runtime gave up on it".to_owned())).map_err(refused)
    }

    fn from_bytes(bytes: Vec<u8>) -> Result<Self, String> {
        wire::check(&bytes)?;
        let sha256 = sums::digest(&bytes);
        let model = Model::load(bytes).map_err(|error| format!("is not a network that can be run: {error}"))?;
        let name = |id: &NodeId| model.node_info(*id).and_then(|node| node.name()).unwrap_or("(no name)").to_owned();
        let names = |ids: &[NodeId]| ids.iter().map(name).collect::<Vec<_>>().join(", ");
        let &[input] = model.input_ids() else {
            return Err(format!("has the inputs {}, not {INPUT} alone", names(model.input_ids())));
        };
        if name(&input) != INPUT {
            return Err(format!("has an input {:?}, not {INPUT:?}", name(&input)));
        }
        let output = model.output_ids().iter().copied().find(|id| name(id) == OUTPUT);
        let output = output.ok_or_else(|| format!("has the outputs {}, not {OUTPUT}", names(model.output_ids())))?;
        let node = model.node_info(input).ok_or("has no input")?;
        let shape = node.shape().unwrap_or_default();
        let batch = match &shape[..] {
            [Dimension::Symbolic(_), rest @ ..] if is_grid(rest) => BATCH,
            [Dimension::Fixed(batch), rest @ ..] if is_grid(rest) && (1..=ONNX_BATCH_MAX).contains(batch) => *batch,
            _ => {
                return Err(format!(
                    "has an input {INPUT} of shape [{}], not [batch, 1, {GRID_CELLS}, {GRID_CELLS}] with a batch that is \
                     free or 1 to {ONNX_BATCH_MAX}",
                    written(&shape)
                ));
            }
        };
        if node.dtype().is_some_and(|dtype| dtype != ValueType::Tensor(DataType::Float)) {
            return Err(format!("has an input {INPUT} of another type than float32"));
        }
        let about = model.metadata().get(about::KEY).map(About::parse).transpose();
        let about = about.map_err(|error| format!("has metadata {:?} that cannot be read: {error}", about::KEY))?;
        let mut network = Self { model: Arc::new(model), input, output, batch, numbers: 0, about, sha256 };
        let pool = Arc::new(ThreadPool::with_num_threads(1));
        let (numbers, _) = network.run(&[&OccupancyGrid::free()], &pool)?;
        if numbers != 2 && numbers != OUTPUTS {
            return Err(format!("answers {numbers} numbers per grid, not (u, w) or (u, w, raw_u, raw_w)"));
        }
        network.numbers = numbers;
        network.check_independence(&pool)?;
        Ok(network)
    }

    /// Refuses a network whose answer to a grid depends on the other grids of its batch: which cars share a batch depends on
    /// the number of threads.
    fn check_independence(&self, pool: &Arc<ThreadPool>) -> Result<(), String> {
        let (free, mut striped) = (OccupancyGrid::free(), OccupancyGrid::free());
        (0..GRID_CELLS).step_by(2).for_each(|row| striped.occupy_row(row, u32::MAX >> (32 - GRID_CELLS)));
        let first = |others: &OccupancyGrid| {
            let grids: Vec<&OccupancyGrid> =
                std::iter::once(&free).chain(std::iter::repeat_n(others, self.batch - 1)).collect();
            let (numbers, values) = self.run(&grids, pool)?;
            Ok::<_, String>(values[..numbers].iter().map(|value| value.to_bits()).collect::<Vec<_>>())
        };
        if first(&free)? == first(&striped)? {
            return Ok(());
        }
        Err("answers one grid differently when others stand beside it in the batch, as batch normalisation does in training \
             mode; export it in evaluation mode"
            .to_owned())
    }

    /// What lotpilot wrote into the file; `None` if another program made it.
    pub fn about(&self) -> Option<&About> {
        self.about.as_ref()
    }

    /// SHA-256 of the file.
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    /// Whether it answers standard deviations as well.
    pub fn has_spread(&self) -> bool {
        self.numbers == OUTPUTS
    }

    /// Answers every grid, in order; with NaN where the network fails.
    pub(crate) fn predict(
        &self,
        grids: &[&OccupancyGrid],
        mirror_averaging: bool,
        pool: &Arc<ThreadPool>,
    ) -> Vec<Prediction> {
        let answers = if mirror_averaging {
            let mirrored: Vec<OccupancyGrid> = grids.iter().map(|grid| grid.mirrored()).collect();
            let both: Vec<_> = grids.iter().copied().chain(&mirrored).collect();
            let mut answers = self.raw(&both, pool);
            let of_images = answers.split_off(grids.len());
            for (answer, [u, w, raw_u, raw_w]) in answers.iter_mut().zip(of_images) {
                let image = [1.0 - u, w, raw_u, raw_w];
                *answer = std::array::from_fn(|i| 0.5 * (answer[i] + image[i]));
            }
            answers
        } else {
            self.raw(grids, pool)
        };
        answers.into_iter().map(Prediction::from_raw).collect()
    }

    /// Raw outputs per grid; those that the network does not have are 0, and all are NaN if it fails.
    fn raw(&self, grids: &[&OccupancyGrid], pool: &Arc<ThreadPool>) -> Vec<[f32; OUTPUTS]> {
        let answer = |grids: &[&OccupancyGrid]| match self.run(grids, pool) {
            Ok((numbers, values)) if numbers == self.numbers => {
                let raw = |row: &[f32]| std::array::from_fn(|i| row.get(i).copied().unwrap_or(0.0));
                values.chunks_exact(numbers).take(grids.len()).map(raw).collect()
            }
            _ => vec![[f32::NAN; OUTPUTS]; grids.len()],
        };
        // Within the pool, its thread is not woken for every batch.
        pool.run(|| grids.chunks(self.batch).flat_map(answer).collect())
    }

    /// Runs a whole batch whose last rows are free ground: how many numbers each row has, and all of them.
    fn run(&self, grids: &[&OccupancyGrid], pool: &Arc<ThreadPool>) -> Result<(usize, Vec<f32>), String> {
        let mut cells: Vec<f32> = Vec::with_capacity(self.batch * CELLS);
        cells.extend(grids.iter().flat_map(|grid| grid.cells()).map(f32::from));
        cells.resize(self.batch * CELLS, 0.0);
        let shape = [self.batch, 1, GRID_CELLS, GRID_CELLS];
        let input = Value::from_shape(shape, cells).map_err(|error| error.to_string())?;
        let options = RunOptions::default().with_thread_pool(Some(Arc::clone(pool)));
        let [output] = self
            .model
            .run_n(vec![(self.input, input.into())], [self.output], Some(options))
            .map_err(|error| format!("cannot be run: {error}"))?;
        let (shape, values) = output
            .into_shape_vec::<f32, 2>()
            .map_err(|error| format!("answers {OUTPUT} in another form than float32 [batch, 4]: {error}"))?;
        match shape {
            [rows, numbers] if rows == self.batch => Ok((numbers, values)),
            [rows, _] => Err(format!("answers {rows} rows to {} grids", self.batch)),
        }
    }
}

fn is_grid(shape: &[Dimension]) -> bool {
    let expected = [1, GRID_CELLS, GRID_CELLS];
    shape.len() == expected.len()
        && shape.iter().zip(expected).all(|(found, expected)| matches!(found, Dimension::Fixed(n) if *n == expected))
}

fn written(shape: &[Dimension]) -> String {
    let one = |dimension: &Dimension| match dimension {
        Dimension::Fixed(length) => length.to_string(),
        Dimension::Symbolic(name) => name.clone(),
    };
    shape.iter().map(one).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests;
