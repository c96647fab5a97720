//! Which views there are at first, and what they show.

use crate::lot::extent;
use sim::map::Map;

/// A part of the window.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Layout {
    /// Side by side, each with its share of the width.
    Columns(Vec<(f32, Layout)>),
    /// One below the other, each with its share of the height.
    Rows(Vec<(f32, Layout)>),
    /// One behind the other; the first is shown.
    Tabs(Vec<Layout>),
    /// A view.
    View(View),
}

/// A view.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct View {
    /// Its title.
    pub(crate) name: String,
    /// What it draws.
    pub(crate) kind: ViewKind,
    /// Entity paths, `/**` at the end for all below; `-` before one leaves it out.
    pub(crate) contents: Vec<String>,
    /// Entities of which everything up to now is shown, not the latest only.
    pub(crate) trails: Vec<String>,
}

/// What a view draws.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum ViewKind {
    /// The scene in space.
    Scene(Eye),
    /// A picture.
    Picture,
    /// Signals over time, with the range of their axis.
    Signals {
        /// Lowest and highest value; as found if `None`.
        range: Option<[f64; 2]>,
    },
    /// States over time.
    States,
    /// A log.
    Log,
    /// A text.
    Document,
}

/// The point from which the scene is seen.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Eye {
    /// Position of the eye; in the frame of `follows`, if set.
    pub(crate) position: [f32; 3],
    /// What it looks at.
    pub(crate) target: [f32; 3],
    /// Direction that is up on the screen.
    pub(crate) up: [f32; 3],
    /// Entity the eye moves with.
    pub(crate) follows: Option<String>,
}

impl From<View> for Layout {
    fn from(view: View) -> Self {
        Self::View(view)
    }
}

/// Vertical opening of the viewer's eye, radians.
const OPENING_RAD: f32 = 0.96;

/// Around the drivable area, metres: parked cars stand there.
const MARGIN_M: f32 = 14.0;

/// A lot alone.
pub(crate) fn of_lot(map: &Map) -> Layout {
    let lot = View { contents: vec!["lot/**".to_owned()], ..whole_lot(map, &[], 1.65) };
    Layout::Columns(vec![(4.0, lot.into()), (1.0, document("Legend", "legend"))])
}

/// Drives side by side, by the entities they are found under. The viewer's notifications appear in the upper right
/// corner, so only the legend is there. Shares fit a window of 1600 × 900 points.
pub(crate) fn of_drives(map: &Map, roots: &[String]) -> Layout {
    let is_alone = roots.len() == 1;
    let closely: Vec<(f32, Layout)> = roots.iter().map(|root| (1.0, around_the_car(root).into())).collect();
    let sensors = roots.iter().map(|root| (1.0, sensors_of(root, !is_alone)));
    let lot = whole_lot(map, roots, if is_alone { 2.4 } else { 1.6 });
    let beside = Layout::Rows(vec![(1.5, lot.into()), (1.0, Layout::Columns(sensors.collect()))]);
    let texts = Layout::Tabs(vec![
        document("Legend", "legend"),
        view("Events", ViewKind::Log, roots.iter().map(|root| format!("{root}/events")).collect()).into(),
    ]);
    let shares = if is_alone { [1.3, 2.1, 0.9] } else { [2.0, 1.4, 0.88] };
    let top = [Layout::Columns(closely), beside, texts];
    let (states, bars) = states_of(roots);
    // A title, a scale and a bar each.
    let states_share = 0.25 + 0.31 * bars as f32;
    let top = Layout::Columns(shares.into_iter().zip(top).collect());
    Layout::Rows(vec![(3.7, top), (states_share, states.into()), (1.4, signals(roots))])
}

/// Tables of a run: entity and file.
pub(crate) const TABLES: [(&str, &str); 2] = [("tables/table1", "table1.md"), ("tables/summary", "summary.md")];

/// A training.
pub(crate) fn of_training() -> Layout {
    let plot = |name: &str, signals: &str, range| {
        (1.0, Layout::from(view(name, ViewKind::Signals { range }, vec![format!("{signals}/**")])))
    };
    let curves = Layout::Columns(vec![
        plot("Loss, parts", "training/loss", None),
        plot("Validation, negative log-likelihood", "training/validation", None),
        plot("Validation error, m", "training/validation_error", None),
        plot("Learning rate", "training/learning_rate", None),
    ]);
    let tables = TABLES.map(|(entity, file)| document(file, entity)).to_vec();
    let rounds = vec![
        plot("η̂ per iteration", "rounds/eta_hat", Some([0.0, 1.0])),
        plot("Samples per round", "rounds/samples", None),
        plot("Near-collisions per 100 m", "rounds/near_collisions", None),
        (1.6, Layout::Tabs(tables)),
    ];
    Layout::Rows(vec![(1.2, curves), (1.0, Layout::Columns(rounds))])
}

/// Who drives and which rule the expert follows, and how many bars that takes. Of several drivers everyone drives alone,
/// as the titles say; what differs is the expert's rule beside them.
fn states_of(roots: &[String]) -> (View, usize) {
    let every = |state: &str| roots.iter().map(|root| format!("{root}/{state}")).collect::<Vec<String>>();
    let (name, states) = if roots.len() > 1 {
        ("The expert's rule", every("expert_rule"))
    } else {
        ("At the wheel, and the expert's rule", [every("driver"), every("expert_rule")].concat())
    };
    let bars = states.len();
    (view(name, ViewKind::States, states), bars)
}

fn view(name: &str, kind: ViewKind, contents: Vec<String>) -> View {
    View { name: name.to_owned(), kind, contents, trails: Vec::new() }
}

fn document(name: &str, entity: &str) -> Layout {
    view(name, ViewKind::Document, vec![entity.to_owned()]).into()
}

/// The car from above, not far behind, with what was weighed.
fn around_the_car(root: &str) -> View {
    // In the frame of the car: behind it, high up, looking at what lies ahead.
    let eye = Eye {
        position: [-6.0, 0.0, 22.0],
        target: [4.0, 0.0, 0.0],
        up: [0.0, 0.0, 1.0],
        follows: Some(format!("{root}/car")),
    };
    let contents =
        vec!["lot/**".to_owned(), format!("{root}/**"), format!("-{root}/sensors/**"), format!("-{root}/signals/**")];
    View { trails: trails(root), ..view(&format!("{root}, from behind"), ViewKind::Scene(eye), contents) }
}

/// Everything from above; cars without what they weigh. `aspect`: width of the view over its height.
fn whole_lot(map: &Map, roots: &[String], aspect: f32) -> View {
    let (centre, size) = extent(map);
    // A lot that is higher than wide lies on its side, so that it is shown as large.
    let is_turned = size.y > size.x;
    let (width_m, depth_m) = if is_turned { (size.y, size.x) } else { (size.x, size.y) };
    let needed_m = (depth_m + MARGIN_M).max((width_m + MARGIN_M) / aspect);
    let height_m = 0.5 * needed_m / (0.5 * OPENING_RAD).tan();
    // Looking down, but not quite: what lies beyond the centre is up on the screen.
    let back_m = 0.02 * height_m;
    let (x, y) = if is_turned { (centre.x + back_m, centre.y) } else { (centre.x, centre.y - back_m) };
    let eye = Eye { position: [x, y, height_m], target: [centre.x, centre.y, 0.0], up: [0.0, 0.0, 1.0], follows: None };
    let mut contents = vec!["lot/**".to_owned()];
    for root in roots {
        let shown = ["car", "car/body", "swept", "driven", "near_collisions"];
        contents.extend(shown.map(|entity| format!("{root}/{entity}")));
    }
    View {
        trails: roots.iter().flat_map(|root| trails(root)).collect(),
        ..view("The whole lot", ViewKind::Scene(eye), contents)
    }
}

/// Entities of which every piece up to now is shown.
fn trails(root: &str) -> Vec<String> {
    ["swept", "driven"].map(|entity| format!("{root}/{entity}")).to_vec()
}

fn sensors_of(root: &str, is_one_of_many: bool) -> Layout {
    let picture = |name: &str, entity: &str| -> Layout {
        view(name, ViewKind::Picture, vec![format!("{root}/sensors/{entity}")]).into()
    };
    // Narrow tabs: the first one names the driver.
    let grid = if is_one_of_many { root } else { "grid 25×25" };
    let pictures = vec![picture(grid, "grid"), picture("view, noisy", "noisy"), picture("view, clean", "clean")];
    if is_one_of_many {
        return Layout::Tabs(pictures);
    }
    Layout::Columns(pictures.into_iter().map(|picture| (1.0, picture)).collect())
}

fn signals(roots: &[String]) -> Layout {
    let plot = |name: &str, signals: &str, range| {
        let contents = roots.iter().map(|root| format!("{root}/signals/{signals}")).collect();
        Layout::from(view(name, ViewKind::Signals { range }, contents))
    };
    let distances = Some([0.0, 1.5]);
    // A line per driver, or all that is known of one.
    let mut plots = if roots.len() > 1 {
        vec![
            plot("Steering, ° (left +)", "steering/actual", None),
            plot("Speed, m/s", "speed/actual", Some([0.0, 2.6])),
            Layout::Tabs(vec![
                plot("Clearance, m", "distance/clearance", distances),
                plot("Safe ratio", "distance/safe_ratio", Some([0.0, 1.1])),
            ]),
        ]
    } else {
        vec![
            plot("Steering, ° (left +)", "steering/**", None),
            plot("Speed, m/s", "speed/**", Some([0.0, 2.6])),
            plot("Clearance, m; safe ratio", "distance/**", distances),
        ]
    };
    plots.push(plot("τ̂, image fraction", "discrepancy/**", Some([0.0, 0.4])));
    plots.push(plot("χ̂, image fraction", "doubt/**", Some([0.0, 0.2])));
    Layout::Columns(plots.into_iter().map(|plot| (1.0, plot)).collect())
}
