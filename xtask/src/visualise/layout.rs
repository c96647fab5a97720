//! What is looked at first.

use super::drive::Detail;
use super::lot::extent;
use protocol::{Eye, Layout, View, ViewKind};
use sim::map::Map;

/// Vertical opening of the viewer's eye, radians.
const OPENING_RAD: f32 = 0.96;

/// A lot alone.
pub fn of_lot(map: &Map) -> Layout {
    let lot = View { contents: vec!["lot/**".to_owned()], ..whole_lot(map, &[], 1.5) };
    Layout::Columns(vec![(4.0, lot.into()), (1.0, document("Legend", "legend"))])
}

/// Drives side by side, by the entities they are found under.
pub fn of_drives(map: &Map, roots: &[String], detail: Detail) -> Layout {
    let closely: Vec<(f32, Layout)> = roots.iter().map(|root| (1.0, around_the_car(root).into())).collect();
    let aspect = if roots.len() == 1 { 1.2 } else { 0.8 };
    let overview = Layout::Tabs(vec![
        whole_lot(map, roots, aspect).into(),
        document("Legend", "legend"),
        view("Events", ViewKind::Log, roots.iter().map(|root| format!("{root}/events")).collect()).into(),
    ]);
    let sensors = roots.iter().map(|root| (1.0, sensors_of(root, detail, roots.len() > 1)));
    let beside = Layout::Rows(vec![(1.5, overview), (1.0, Layout::Columns(sensors.collect()))]);
    let top = Layout::Columns(vec![(1.6, Layout::Columns(closely)), (1.0, beside)]);
    let (states, bars) = states_of(roots, detail);
    // A title, a scale and a bar each, whole in a window of 900 points.
    let states_share = 0.25 + 0.31 * bars as f32;
    Layout::Rows(vec![(3.4, top), (states_share, states.into()), (1.4, signals(roots, detail))])
}

/// Tables of a run: entity and file.
pub const TABLES: [(&str, &str); 2] = [("tables/table1", "table1.md"), ("tables/summary", "summary.md")];

/// A training.
pub fn of_training(with_tables: bool) -> Layout {
    let plot = |name: &str, signals: &str, range| {
        (1.0, Layout::from(view(name, ViewKind::Signals { range }, vec![format!("{signals}/**")])))
    };
    let curves = Layout::Columns(vec![
        plot("Loss, parts", "training/loss", None),
        plot("Validation, negative log-likelihood", "training/validation", None),
        plot("Validation error, m", "training/validation_error", None),
        plot("Learning rate", "training/learning_rate", None),
    ]);
    let mut rounds = vec![
        plot("η̂ per iteration", "rounds/eta_hat", Some([0.0, 1.0])),
        plot("Samples per round", "rounds/samples", None),
        plot("Near-collisions per 100 m", "rounds/near_collisions", None),
    ];
    if with_tables {
        let tables = TABLES.map(|(entity, file)| document(file, entity)).to_vec();
        rounds.push((1.6, Layout::Tabs(tables)));
    }
    Layout::Rows(vec![(1.2, curves), (1.0, Layout::Columns(rounds))])
}

/// Who drives and which rule the expert follows, and how many bars that takes. Of several drivers everyone drives alone,
/// as the titles say; what differs is the expert's rule beside them.
fn states_of(roots: &[String], detail: Detail) -> (View, usize) {
    let every = |state: &str| roots.iter().map(|root| format!("{root}/{state}")).collect::<Vec<String>>();
    let (name, states) = match detail {
        Detail::Frames => ("At the wheel", every("driver")),
        Detail::Everything if roots.len() > 1 => ("The expert's rule", every("expert_rule")),
        Detail::Everything => ("At the wheel, and the expert's rule", [every("driver"), every("expert_rule")].concat()),
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
    let needed_m = (size.y * 1.1).max(size.x * 1.1 / aspect);
    let height_m = 0.5 * needed_m / (0.5 * OPENING_RAD).tan();
    let eye = Eye {
        position: [centre.x, centre.y - 0.02 * height_m, height_m],
        target: [centre.x, centre.y, 0.0],
        up: [0.0, 0.0, 1.0],
        follows: None,
    };
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

/// Entities that are pieces of a way.
fn trails(root: &str) -> Vec<String> {
    ["swept", "driven"].map(|entity| format!("{root}/{entity}")).to_vec()
}

fn sensors_of(root: &str, detail: Detail, is_one_of_many: bool) -> Layout {
    let picture = |name: &str, entity: &str| -> Layout {
        view(name, ViewKind::Picture, vec![format!("{root}/sensors/{entity}")]).into()
    };
    // Narrow tabs: the first one names the driver.
    let mut pictures = vec![picture(if is_one_of_many { root } else { "grid 25×25" }, "grid")];
    if detail == Detail::Everything {
        pictures.extend([picture("view, noisy", "noisy"), picture("view, clean", "clean")]);
    }
    if is_one_of_many {
        return Layout::Tabs(pictures);
    }
    Layout::Columns(pictures.into_iter().map(|picture| (1.0, picture)).collect())
}

fn signals(roots: &[String], detail: Detail) -> Layout {
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
    if detail == Detail::Everything {
        plots.push(plot("τ̂, image fraction", "discrepancy/**", Some([0.0, 0.4])));
    }
    plots.push(plot("χ̂, image fraction", "doubt/**", Some([0.0, 0.2])));
    Layout::Columns(plots.into_iter().map(|plot| (1.0, plot)).collect())
}
