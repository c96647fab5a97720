use super::*;
use evaluation::calibration::AxisCalibration;
use policy::fit::learning::LearningCurve;
use roxmltree::{Document, Node};

/// Every text of a picture with its place.
fn texts<'a>(document: &'a Document<'a>) -> Vec<(String, f64, f64)> {
    let text = |node: Node<'_, '_>| {
        let place = |axis| node.attribute(axis).unwrap().parse::<f64>().unwrap();
        (node.text().unwrap_or_default().trim().to_owned(), place("x"), place("y"))
    };
    document.descendants().filter(|node| node.has_tag_name("text")).map(text).collect()
}

/// Position of a text.
fn place(texts: &[(String, f64, f64)], wanted: &str) -> (f64, f64) {
    let found = texts.iter().find(|(text, ..)| text == wanted);
    found.map_or_else(|| panic!("{wanted:?} is not among {texts:?}"), |&(_, x, y)| (x, y))
}

fn rows() -> Vec<RateRow> {
    [("expert", 0.0, [0.0, 0.07], 0), ("DAgger", 0.27, [0.15, 0.45], 1), ("BC", 0.62, [0.42, 0.87], 2)]
        .map(|(name, per_100m, interval, group)| RateRow { name: name.to_owned(), per_100m, interval, group })
        .to_vec()
}

fn noise() -> Vec<RateSeries> {
    let series = |name: &str, slope: f64| {
        let point = |i: usize| {
            let times_paper = 0.5 * i as f64;
            let per_100m = slope * times_paper;
            RatePoint { x: times_paper, per_100m, interval: [0.7 * per_100m, 1.4 * per_100m + 0.1] }
        };
        RateSeries { name: name.to_owned(), points: (0..5).map(point).collect() }
    };
    vec![series("DAgger", 0.4), series("tentacle", 2.0), series("run:runs/a-long-name-of-a-folder/bc", 0.9)]
}

/// Drivers with long names.
fn many(count: usize) -> Vec<RateSeries> {
    let point = |x| RatePoint { x, per_100m: 1.0, interval: [0.9, 1.1] };
    let series = |i| RateSeries {
        name: format!("vvf:planners/a-planner-with-a-name-{i}.toml"),
        points: [0.0, 1.0, 2.0].map(point).to_vec(),
    };
    (0..count).map(series).collect()
}

fn ratios() -> Vec<Distribution> {
    let row = |group: usize, name: &str, middle: f64| Distribution {
        name: name.to_owned(),
        values: (0..40).map(|i| middle + 0.002 * f64::from(i * 17 % 40 - 20)).collect(),
        group,
    };
    vec![row(0, "expert", 0.88), row(1, "DAgger", 0.86), row(2, "tentacle", 0.81)]
}

fn rounds() -> Vec<LearningCurve> {
    let round = |name: &str, steps: u32, floor: f64| LearningCurve {
        validation_rmse_m: (1..=steps / 250).map(|k| (250 * k, 0.3 + libm::exp(-f64::from(k) / 3.0))).collect(),
        name: name.to_owned(),
        training: (1..=steps)
            .map(|s| (s, floor + 3.0 * libm::exp(-f64::from(s) / 300.0) + 0.1 * f64::from(s * 7919 % 13) / 13.0))
            .collect(),
        validation: (1..=steps / 250).map(|k| (250 * k, floor + 0.2 + 2.0 * libm::exp(-f64::from(k) / 2.0))).collect(),
    };
    vec![round("BC", 7000, -4.1), round("i = 1", 4000, -3.6), round("i = 2", 4000, -3.4)]
}

fn axes() -> Vec<AxisCalibration> {
    ["across", "along"]
        .map(|name| {
            let sample = |i: u32| {
                let sigma = 0.1 + 0.001 * f64::from(i);
                (1.3 * sigma * (f64::from(i * 7919 % 200) / 100.0 - 1.0), sigma)
            };
            AxisCalibration::of(name, (0..1000).map(sample))
        })
        .to_vec()
}

fn groups() -> Vec<BarGroup> {
    let group = |(i, name): (usize, &str)| {
        let bar = |j: usize| {
            let value = 0.3 * (i + j) as f64;
            let (driver, is_papers) = (j / 2, j.is_multiple_of(2));
            Bar { driver, value, interval: (!is_papers).then_some([0.8 * value, 1.3 * value + 0.1]), is_papers }
        };
        BarGroup { name: name.to_owned(), bars: (0..6).map(bar).collect() }
    };
    ["lot-a", "lot-b", "lot-c"].into_iter().enumerate().map(group).collect()
}

fn all() -> Vec<(&'static str, String)> {
    let ours = EtaSeries { name: "this run".to_owned(), points: vec![(1, 0.873), (2, 0.839), (3, 0.85)] };
    let paper = [(1, 0.44), (2, 0.64), (3, 0.65), (4, 0.74), (5, 0.9)];
    vec![
        ("learning", learning(&rounds())),
        ("eta", eta(&[ours], &paper, 0.9)),
        ("rates", rates("Near-collisions, noise paper", &rows())),
        ("noise", rates_against_noise("Near-collisions against noise, all lots", &noise())),
        ("many", rates_against_noise("Near-collisions against noise, all lots", &many(40))),
        ("lots", rates_against_lots("Near-collisions against lots", &["9", "36", "144"].map(str::to_owned), &noise())),
        ("safe-ratios", safe_ratios("Safe ratio, noise paper", &ratios())),
        ("long-title", safe_ratios(&format!("Safe ratio on {}, noise paper", "a-long-name-".repeat(8)), &ratios())),
        ("bars", bars("Near-collisions", "per 100 m", &["DAgger", "tentacle", "vvf"], &groups())),
        ("calibration", calibration(&axes())),
    ]
}

/// Widths are estimated as in [`style`], which is wider than the fonts in use.
#[test]
fn no_text_is_clipped_and_none_stands_on_another() {
    let mut wrong = Vec::new();
    for (name, svg) in all() {
        if let Ok(folder) = std::env::var("XTASK_PLOTS") {
            std::fs::write(format!("{folder}/{name}.svg"), &svg).unwrap();
        }
        let document = Document::parse(&svg).unwrap_or_else(|error| panic!("{name}: {error}"));
        let height: f64 = document.root_element().attribute("height").unwrap().parse().unwrap();
        let mut boxes: Vec<(String, [f64; 4])> = Vec::new();
        for node in document.descendants().filter(|node| node.has_tag_name("text")) {
            if node.attribute("transform").is_some() {
                continue;
            }
            let number = |key: &str| node.attribute(key).unwrap().parse::<f64>().unwrap();
            let words = node.text().unwrap_or_default().trim();
            if words.is_empty() {
                continue;
            }
            let size = number("font-size");
            let width = 0.52 * size * words.chars().count() as f64;
            let left = number("x")
                - match node.attribute("text-anchor") {
                    Some("end") => width,
                    Some("middle") => 0.5 * width,
                    _ => 0.0,
                };
            let middle = match node.attribute("dy") {
                Some("0.76em") => number("y") + 0.4 * size, // hangs below its place
                _ => number("y"),
            };
            if left < 0.0 || left + width > f64::from(style::WIDTH_PX) {
                wrong.push(format!("{name}: {words:?} from {left}"));
            }
            if !(0.0..=height).contains(&middle) {
                wrong.push(format!("{name}: {words:?} at height {middle} of {height}"));
            }
            let box_px = [left, left + width, middle - 0.35 * size, middle + 0.35 * size];
            for (other, [l, r, t, b]) in &boxes {
                let apart = box_px[1] < *l || *r < box_px[0] || box_px[3] < *t || *b < box_px[2];
                if !apart {
                    wrong.push(format!("{name}: {words:?} stands on {other:?}"));
                }
            }
            boxes.push((words.to_owned(), box_px));
        }
        assert!(boxes.len() > 5, "{name} has only {} texts", boxes.len());
        assert_eq!(document.descendants().filter(|node| node.has_tag_name("title")).count(), 1, "{name}");
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The dots of the rates stand over the values of the axis, in the rows of their drivers.
#[test]
fn dots_stand_at_their_values() {
    let svg = rates("Near-collisions", &rows());
    let document = Document::parse(&svg).unwrap();
    let texts = texts(&document);
    let (zero, _) = place(&texts, "0.0");
    let (one, _) = place(&texts, "0.8");
    let circle = document.descendants().find(|node| node.has_tag_name("circle")).unwrap();
    let number = |key: &str| circle.attribute(key).unwrap().parse::<f64>().unwrap();
    assert!((number("cx") - zero).abs() <= 1.0, "the expert's rate is 0: {} against {zero}", number("cx"));
    assert!((number("cy") - place(&texts, "expert").1).abs() <= 1.0);
    // DAgger's marker is a triangle around 0.27.
    let triangle = document.descendants().find(|node| node.has_tag_name("polygon")).unwrap();
    let xs: Vec<f64> = triangle
        .attribute("points")
        .unwrap()
        .split_whitespace()
        .map(|pair| pair.split(',').next().unwrap().parse().unwrap())
        .collect();
    let middle = 0.5 * (xs.iter().copied().fold(f64::MAX, f64::min) + xs.iter().copied().fold(f64::MIN, f64::max));
    assert!((middle - (zero + 0.27 / 0.8 * (one - zero))).abs() <= 1.5, "{middle}: 0 at {zero}, 0.8 at {one}");
}

/// The upper end of a driver without near-collisions in 280 km: 0.0005 and 0.001 both stood there as 0.001.
#[test]
fn ticks_of_small_rates_are_told_apart() {
    for upper in [0.0013, 0.0024, 0.006, 0.00011] {
        let row = RateRow { name: "expert".to_owned(), per_100m: 0.0, interval: [0.0, upper], group: 0 };
        let svg = rates("Near-collisions", &[row]);
        let texts = texts(&Document::parse(&svg).unwrap());
        let ticks: Vec<f64> = texts.iter().filter_map(|(text, ..)| text.parse().ok()).collect();
        let steps: Vec<f64> = ticks.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(steps.len() > 1 && steps.iter().all(|step| *step > 0.0 && (step - steps[0]).abs() < 1e-9), "{ticks:?}");
    }
}

/// With forty drivers the legend left no room for what it explains.
#[test]
fn a_long_legend_leaves_its_plot_as_high_as_a_short_one() {
    let height = |count| {
        let svg = rates_against_effort("Near-collisions", &many(count));
        let document = Document::parse(&svg).unwrap();
        let texts = texts(&document);
        place(&texts, "0.0").1 - place(&texts, "1.0").1
    };
    assert!((height(40) - height(4)).abs() <= 1.0, "{} and {} px", height(40), height(4));
}

/// A rule that asked at 13.7 % of the ticks stood at 14.5 %, and one that asked at all of them at 104 %.
#[test]
fn points_are_set_apart_only_where_they_would_hide_each_other() {
    let point = |x| RatePoint { x, per_100m: 1.0, interval: [0.9, 1.1] };
    let rule = |x| RateSeries { name: "a rule".to_owned(), points: vec![point(x)] };
    let rules: Vec<RateSeries> = std::iter::once(30.0).chain([100.0; 30]).map(rule).collect();
    let svg = rates_against_effort("Rules", &rules);
    let document = Document::parse(&svg).unwrap();
    let texts = texts(&document);
    let [zero, all] = ["0", "100"].map(|percent| place(&texts, percent).0);
    let circles = document.descendants().filter(|node| node.has_tag_name("circle"));
    let places: Vec<f64> = circles.map(|circle| circle.attribute("cx").unwrap().parse().unwrap()).collect();
    // Those of the legend come first.
    let (_, places) = places.split_at(places.len() / 2);
    assert!((places[0] - (zero + 0.3 * (all - zero))).abs() <= 1.0, "{places:?}: 0 at {zero}, 100 at {all}");
    let (first, last) = (places[1], places[places.len() - 1]);
    assert!(first < all && all < last && last - first < 0.06 * (all - zero), "{places:?}: 100 at {all}");
}

#[test]
fn thousands_stand_apart() {
    for (value, text) in [(9999.0, "9999"), (10_000.0, "10 000"), (1_234_567.0, "1 234 567"), (-123_456.0, "-123 456")]
    {
        assert_eq!(style::number(value, 0).replace('\u{202f}', " "), text);
    }
}

#[test]
fn calibration_counts_what_lies_within_sigma_and_bins_by_sigma() {
    // Errors of 0.5 σ, 1.5 σ and 3 σ in turn.
    let samples = (0..300).map(|i| {
        let sigma = 0.1 + f64::from(i / 30) * 0.1;
        (sigma * [0.5, -1.5, 3.0][i as usize % 3], sigma)
    });
    let axis = AxisCalibration::of("across", samples);
    assert_eq!((axis.samples, axis.bins.len()), (300, 10));
    assert!((axis.coverage[0] - 1.0 / 3.0).abs() < 1e-9 && (axis.coverage[1] - 2.0 / 3.0).abs() < 1e-9);
    let rms = ((0.25 + 2.25 + 9.0) / 3.0_f64).sqrt();
    for (i, &[sigma, error]) in axis.bins.iter().enumerate() {
        assert!((sigma - 0.1 * (i as f64 + 1.0)).abs() < 1e-9 && (error - sigma * rms).abs() < 1e-9, "{i}");
    }
}

#[test]
fn nothing_to_show_is_still_a_picture() {
    for svg in [
        learning(&[]),
        eta(&[], &[], 0.9),
        rates("none", &[]),
        rates_against_noise("none", &[]),
        rates_against_lots("none", &[], &[]),
        safe_ratios("none", &[]),
        calibration(&[]),
        bars("none", "nothing", &[], &[]),
        safe_ratios("one & <all>", &[Distribution { name: "a < b & c".to_owned(), values: vec![], group: 0 }]),
    ] {
        Document::parse(&svg).unwrap();
    }
}

#[test]
fn learning_curves_show_metres_first() {
    let svg = learning(&rounds());
    let document = Document::parse(&svg).unwrap();
    let texts = texts(&document);
    let height = |title| place(&texts, title).1;
    let (error, validation) = (height("Validation error of the look-ahead point"), height("Validation loss"));
    assert!(error < validation && validation < height("Training loss"), "{texts:?}");
}
