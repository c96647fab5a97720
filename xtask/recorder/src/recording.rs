//! One recording: a stream of Rerun, and what waits to be sent to it in one piece.

use crate::blueprint;
use crate::columns::Column;
use crate::shapes;
use anyhow::{Context as _, bail};
use protocol::{Clock, Header, Mark, Shape, Sink};
use rerun::{ApplicationId, RecordingStream, RecordingStreamBuilder, SpawnOptions};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};

/// Rows of an entity that are sent in one piece: a chunk of the size the viewer likes, and a bound for what waits.
const ROWS: usize = 1024;
/// The same in bytes, for pictures.
const BYTES: usize = 1 << 20;
/// A viewer that looks on gets what there is this often.
const LIVE_EVERY: Duration = Duration::from_millis(200);

/// An open recording.
pub struct Recording {
    stream: RecordingStream,
    columns: BTreeMap<String, Column>,
    is_live: bool,
    sent: Instant,
}

impl Recording {
    /// Begins a recording and sends its layout.
    pub fn begin(header: Header) -> anyhow::Result<Self> {
        // Blanks mean nothing to Rerun there.
        let application = ApplicationId::try_from(header.application.replace(' ', "-"))?;
        let builder = RecordingStreamBuilder::new(application.clone());
        let stream = match &header.sink {
            Sink::File(path) => builder.save(Path::new(path)).with_context(|| path.clone())?,
            Sink::Connect(url) => match url {
                Some(url) => builder.connect_grpc_opts(url.as_str()).with_context(|| url.clone())?,
                None => builder.connect_grpc().context("the viewer of this machine")?,
            },
            Sink::Spawn => spawn(builder)?,
        };
        stream.send_recording_name(header.name.as_str())?;
        blueprint::send(&stream, application, &header)?;
        let is_live = !matches!(header.sink, Sink::File(_));
        Ok(Self { stream, columns: BTreeMap::new(), is_live, sent: Instant::now() })
    }

    /// Sends shapes that hold at all times.
    pub fn always(&self, marks: Vec<Mark>) -> anyhow::Result<()> {
        marks.iter().try_for_each(|Mark { entity, shape }| shapes::send_static(&self.stream, entity, shape))
    }

    /// Takes shapes that hold from a moment on.
    pub fn at(&mut self, clock: Clock, marks: Vec<Mark>) -> anyhow::Result<()> {
        for Mark { entity, shape } in marks {
            if matches!(shape, Shape::Blocks(_) | Shape::Area(_) | Shape::Signal { .. } | Shape::States(_)) {
                bail!("{entity}: {shape:?} cannot change with time");
            }
            // Entities come back at every tick: only a new one needs a key of its own.
            if !self.columns.contains_key(&entity) {
                self.columns.insert(entity.clone(), Column::default());
            }
            let column = self.columns.get_mut(&entity).expect("it was just inserted");
            column.push(clock, shape)?;
            if column.rows() >= ROWS || column.bytes() >= BYTES {
                column.send(&self.stream, &entity)?;
            }
        }
        if self.is_live && self.sent.elapsed() >= LIVE_EVERY {
            self.send_all()?;
        }
        Ok(())
    }

    /// Sends the rest and waits until it is written.
    pub fn end(mut self) -> anyhow::Result<()> {
        self.send_all()?;
        self.stream.flush_blocking().context("a recording cannot be written; is the disk full, or the viewer gone?")?;
        self.stream.disconnect();
        Ok(())
    }

    fn send_all(&mut self) -> anyhow::Result<()> {
        self.sent = Instant::now();
        for (entity, column) in &mut self.columns {
            column.send(&self.stream, entity)?;
        }
        Ok(())
    }
}

/// A viewer of this machine that nobody else can reach.
fn spawn(builder: RecordingStreamBuilder) -> anyhow::Result<RecordingStream> {
    let options = SpawnOptions { extra_args: vec!["--bind=127.0.0.1".to_owned()], ..SpawnOptions::default() };
    builder.spawn_opts(&options).context(
        "no viewer could be started; install the one that fits with: pip install rerun-sdk==0.36.3 (or write a file)",
    )
}
