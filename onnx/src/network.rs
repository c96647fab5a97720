//! A network from a file that anybody may have written.

use crate::about::{self, About};
use crate::{INPUT, OUTPUT, wire};
use policy::network::{Prediction, modes, row_width};
use rten::{DataType, Dimension, Model, NodeId, RunOptions, ThreadPool, Value, ValueType};
use sim::limits::{MODES_MAX, ONNX_BATCH_MAX, ONNX_BYTES_MAX};
use sim::sensing::{GRID_CELLS, OccupancyGrid};
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::{Arc, LazyLock};
use storage::{FileError, read, sums};

const EXPORT: &str = "write it again, as docs/formats.md shows under \"Networks of others: ONNX\"";

/// Grids that are answered in one call where the file leaves that open. Always as many: with another number, a runtime may add
/// in another order, and the answer for one car would depend on how many others are still driving. One: nothing is computed
/// in vain when few cars are left, and rten takes hardly longer for each grid than in larger batches.
const BATCH: usize = 1;

/// Environment variables by which the runtime prints on stdout, where results stand.
const PRINTS: [&str; 3] = ["RTEN_TIMING", "RTEN_OPTIMIZER_DEBUG", "RTEN_INFER_SHAPES_DEBUG"];

/// Cells of a grid.
const CELLS: usize = GRID_CELLS * GRID_CELLS;

/// Where networks answer when they are read: one thread for all of them.
static POOL: LazyLock<Arc<ThreadPool>> = LazyLock::new(|| Arc::new(ThreadPool::with_num_threads(1)));

/// A network that is checked and answers.
#[derive(Clone)]
pub struct OnnxNetwork {
    model: Arc<Model>,
    input: NodeId,
    output: NodeId,
    batch: usize,
    /// What it answers to one grid.
    answer: Answer,
    about: Option<About>,
    sha256: String,
}

impl fmt::Debug for OnnxNetwork {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { batch, answer, sha256, .. } = self;
        write!(f, "OnnxNetwork {{ batch: {batch}, answer: {answer:?}, sha256: {sha256:?} }}")
    }
}

/// Meaning of the numbers that answer one grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Answer {
    /// u and w.
    Point,
    /// This many modes, each u, w and both raw log-variances; if there are several, then their logits.
    Modes(usize),
}

impl Answer {
    /// What so many numbers mean.
    fn of(numbers: usize) -> Option<Self> {
        if numbers == 2 {
            return Some(Self::Point);
        }
        (1..=MODES_MAX).find(|&modes| row_width(modes) == numbers).map(Self::Modes)
    }

    fn numbers(self) -> usize {
        match self {
            Self::Point => 2,
            Self::Modes(modes) => row_width(modes),
        }
    }

    /// Modes of a row of [`OnnxNetwork::rows`].
    fn modes(self) -> usize {
        match self {
            Self::Point => 1,
            Self::Modes(modes) => modes,
        }
    }
}

impl OnnxNetwork {
    /// Reads a file and lets it answer once.
    ///
    /// # Errors
    /// If it cannot be read, is larger than [`ONNX_BYTES_MAX`], is not an ONNX file, uses what the runtime does not
    /// know, or its input or output is not what docs/formats.md says; or if the environment tells the runtime to print.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        if let Some(name) = PRINTS.into_iter().find(|name| std::env::var_os(name).is_some()) {
            let problem = format!("the environment variable {name} makes the runtime print among results");
            return Err(FileError::new(path, problem, "unset it"));
        }
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
        let mut network = Self { model: Arc::new(model), input, output, batch, answer: Answer::Point, about, sha256 };
        let (numbers, _) = network.run(&[&OccupancyGrid::free()], &POOL)?;
        network.answer = Answer::of(numbers).ok_or_else(|| {
            format!(
                "answers {numbers} numbers per grid, not (u, w), or (u, w, raw_u, raw_w), or these four for each of 2 to \
                 {MODES_MAX} modes and then their logits"
            )
        })?;
        network.check_independence()?;
        Ok(network)
    }

    /// Refuses a network whose answer to a grid depends on the other grids of its batch, or on its place there: which cars
    /// share a batch, and in which order, depends on the number of threads.
    fn check_independence(&self) -> Result<(), String> {
        // Alone, a grid has nothing to be mixed with.
        if self.batch == 1 {
            return Ok(());
        }
        let (free, mut striped) = (OccupancyGrid::free(), OccupancyGrid::free());
        (0..GRID_CELLS).step_by(2).for_each(|row| striped.occupy_row(row, u32::MAX >> (32 - GRID_CELLS)));
        let answers_beside = |others: &OccupancyGrid| {
            let grids: Vec<&OccupancyGrid> =
                std::iter::once(&free).chain(std::iter::repeat_n(others, self.batch - 1)).collect();
            let (_, values) = self.run(&grids, &POOL)?;
            let bits: Vec<u32> = values.into_iter().map(f32::to_bits).collect();
            Ok::<_, String>(bits.chunks_exact(self.answer.numbers()).map(<[u32]>::to_vec).collect::<Vec<_>>())
        };
        let (alike, beside_others) = (answers_beside(&free)?, answers_beside(&striped)?);
        if alike.windows(2).any(|neighbours| neighbours[0] != neighbours[1]) {
            return Err(
                "answers one grid differently in another place of the batch; export it with a free batch".to_owned()
            );
        }
        if alike.first() != beside_others.first() {
            return Err("answers one grid differently when others stand beside it in the batch, as batch normalisation does in \
                        training mode; export it in evaluation mode"
                .to_owned());
        }
        Ok(())
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
        self.answer != Answer::Point
    }

    /// Answers every grid, in order; with NaN where the network fails.
    pub(crate) fn predict(
        &self,
        grids: &[&OccupancyGrid],
        mirror_averaging: bool,
        pool: &Arc<ThreadPool>,
    ) -> Vec<Prediction> {
        let raw = modes::answers(grids, self.answer.modes(), mirror_averaging, |grids| self.rows(grids, pool));
        raw.into_iter().map(Prediction::from_raw).collect()
    }

    /// Rows of raw outputs, one per grid, as those of a network of ours. Log-variances that the network does not answer are 0,
    /// and all is NaN if it fails.
    fn rows(&self, grids: &[&OccupancyGrid], pool: &Arc<ThreadPool>) -> Vec<f32> {
        let width = row_width(self.answer.modes());
        let answer = |grids: &[&OccupancyGrid]| {
            let mut rows = Vec::with_capacity(grids.len() * width);
            match self.run(grids, pool) {
                Ok((numbers, values)) if numbers == self.answer.numbers() => {
                    for (index, row) in values.chunks_exact(numbers).take(grids.len()).enumerate() {
                        rows.extend_from_slice(row);
                        rows.resize((index + 1) * width, 0.0);
                    }
                }
                _ => rows.resize(grids.len() * width, f32::NAN),
            }
            rows
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
            .map_err(|error| format!("answers {OUTPUT} in another form than float32 [batch, numbers]: {error}"))?;
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
