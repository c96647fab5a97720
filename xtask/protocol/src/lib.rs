//! What the bench (`xtask`) tells the Rerun recorder (`xtask/recorder`) through a pipe.
//!
//! The bench decides what is shown, where and in which colour; the recorder only translates into Rerun's types. So
//! everything about a recording can be tested without compiling rerun, and nobody but the recorder depends on it.
//!
//! World and ego frames are those of `sim`: metres, x east or ahead, y north or left, angles counter-clockwise in
//! radians; z is up. Entity paths are Rerun's: parts joined by `/`, a child moves with the pose of its parent.

mod layout;
mod wire;

pub use layout::{Eye, Layout, View, ViewKind};
pub use wire::{MESSAGE_BYTES_MAX, read, write};

use serde::{Deserialize, Serialize};

/// Red, green, blue, opacity.
pub type Colour = [u8; 4];
/// x, y, z in metres, in the frame of the entity's parent.
pub type Point = [f32; 3];

/// What is shown from each of a series of moments on.
pub type Moments = Vec<(Clock, Vec<Mark>)>;

/// One step of the conversation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Message {
    /// Begins a recording. Several may be open at once.
    Begin {
        /// By which later messages name it.
        recording: u32,
        /// What it is.
        header: Box<Header>,
    },
    /// Shapes that hold at all times.
    Always {
        /// Which recording.
        recording: u32,
        /// What is shown.
        marks: Vec<Mark>,
    },
    /// Shapes that hold from a moment on, until the same entity is given another.
    At {
        /// Which recording.
        recording: u32,
        /// When. Moments of a recording do not go back.
        clock: Clock,
        /// What is shown.
        marks: Vec<Mark>,
    },
    /// Ends a recording: all of it is written.
    End {
        /// Which recording.
        recording: u32,
    },
}

/// What a recording is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Recordings of one application share the viewer's layout.
    pub application: String,
    /// Shown in the viewer's list of recordings.
    pub name: String,
    /// Where it goes.
    pub sink: Sink,
    /// The first look.
    pub layout: Layout,
    /// The time line that is shown first.
    pub timeline: String,
    /// Simulated seconds that are played again and again; everything is played once if `None`.
    pub focus_s: Option<[f64; 2]>,
}

/// Where a recording goes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Sink {
    /// An `.rrd` file.
    File(String),
    /// A viewer of this machine, started if none runs.
    Spawn,
    /// A viewer that runs, `rerun+http://HOST:PORT/proxy`; `None` = this machine's.
    Connect(Option<String>),
}

/// When.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Clock {
    /// In an episode: time lines `tick` and `sim_time`.
    Episode {
        /// Control tick, from 0.
        tick: i64,
        /// Simulated time, seconds.
        time_s: f64,
    },
    /// In a training: time lines `step` (over all rounds) and `round`.
    Training {
        /// Optimiser step, counted over all rounds.
        step: i64,
        /// 0 = behaviour cloning.
        round: i64,
    },
}

/// Something at a place in the tree of entities.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// Entity path.
    pub entity: String,
    /// What is shown there. An entity that changes keeps one kind of shape.
    pub shape: Shape,
}

impl Mark {
    /// A shape at an entity path.
    pub fn new(entity: impl Into<String>, shape: Shape) -> Self {
        Self { entity: entity.into(), shape }
    }
}

/// What can be shown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Shape {
    /// Moves the entity and its children.
    Pose(Pose),
    /// Dots.
    Dots(Vec<Dot>),
    /// Polylines.
    Strips(Vec<Strip>),
    /// Arrows.
    Arrows(Vec<Arrow>),
    /// Boxes and cylinders that stand on something. Static only.
    Blocks(Vec<Block>),
    /// A flat, filled area. Static only.
    Area(Area),
    /// A picture of a few colours.
    Picture(Picture),
    /// A value of a signal.
    Value(f64),
    /// How the signals of this entity look. Static only.
    Signal {
        /// In the legend, with unit.
        name: String,
        /// Of the line.
        colour: Colour,
        /// Points rather than a line.
        dotted: bool,
    },
    /// The state something is in from now on.
    State(String),
    /// Names and colours of states. Static only.
    States(Vec<(String, Colour)>),
    /// A line of a log.
    Line {
        /// What happened.
        text: String,
        /// Whether it is bad.
        is_warning: bool,
    },
    /// Markdown.
    Document(String),
}

/// Position, heading and size of an entity in its parent's frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Origin.
    pub at: Point,
    /// About the vertical axis.
    pub yaw_rad: f32,
    /// Factors along the entity's own axes.
    pub scale: Point,
}

/// A dot that keeps its size on the screen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Dot {
    /// Where.
    pub at: Point,
    /// Radius on the screen, points.
    pub radius_pt: f32,
    /// Its colour.
    pub colour: Colour,
    /// Text beside it; empty for none.
    pub label: String,
}

/// A polyline that keeps its width on the screen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Strip {
    /// Vertices.
    pub points: Vec<Point>,
    /// Half its width on the screen, points.
    pub radius_pt: f32,
    /// Its colour.
    pub colour: Colour,
}

/// An arrow.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Arrow {
    /// Its foot.
    pub from: Point,
    /// From foot to tip.
    pub vector: Point,
    /// Its colour.
    pub colour: Colour,
}

/// A box, or a cylinder, on a vertical axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Block {
    /// Centre.
    pub centre: Point,
    /// Length, width (diameter twice if round) and height.
    pub size_m: Point,
    /// Of the length axis.
    pub yaw_rad: f32,
    /// Whether it is a cylinder.
    pub is_round: bool,
    /// Its colour; opaque blocks are filled, others are drawn as frames.
    pub colour: Colour,
}

/// A flat, filled area.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Area {
    /// Axis-parallel rectangles: x and y of the lower left and of the upper right corner.
    pub rectangles: Vec<[f32; 4]>,
    /// Height above ground.
    pub z_m: f32,
    /// Its colour.
    pub colour: Colour,
}

/// A picture of a few colours.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Picture {
    /// Pixels per row.
    pub width: u32,
    /// Index into the palette, row by row from the top left.
    pub pixels: Vec<u8>,
    /// Red, green, blue; at most 16 colours.
    pub palette: Vec<[u8; 3]>,
}
