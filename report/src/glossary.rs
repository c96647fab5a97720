//! Terms of the reports, explained once, and linked with a tooltip where a report first uses them.

use crate::page::Page;
use std::fmt::Write as _;

/// A term of the field, of the paper or of this project.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Term {
    /// Its anchor in a page.
    slug: &'static str,
    name: &'static str,
    /// Plain text without quotation marks: it is also a tooltip.
    definition: &'static str,
}

const fn term(slug: &'static str, name: &'static str, definition: &'static str) -> Term {
    Term { slug, name, definition }
}

/// The car heads at something.
pub const NEAR_COLLISION: Term = term(
    "near-collision",
    "Near-collision",
    "The car is within 0.5 m of something that it is heading for. It is stopped, put back on the route and drives on. \
     Rates are per 100 m of route.",
);
/// The body touches something.
pub const CONTACT: Term = term(
    "contact",
    "Contact",
    "The body of the car begins to touch something. A fast near-collision ends in a contact, because stopping takes more \
     than 0.5 m.",
);
/// The smallest distance of a drive.
pub const LEAST_CLEARANCE: Term = term(
    "least-clearance",
    "Least clearance",
    "The smallest distance between the body of the car and ground it cannot drive on, over all runs. Negative: how deep the \
     body was in it. Right to some 5 cm beside corners.",
);
/// How much room a driver keeps.
pub const SAFE_RATIO: Term = term(
    "safe-ratio",
    "Safe ratio",
    "The share of the ground within 1 m of the body that is drivable, averaged over a run. 1 means that nothing came \
     closer than 1 m. The widths of lots a, b and c were chosen so that the expert came near the paper's: there it is no finding.",
);
/// Where the driver wants to go.
pub const LOOK_AHEAD_POINT: Term = term(
    "look-ahead-point",
    "Look-ahead point",
    "The point on the ground that a driver answers with: the controller steers for it and drives faster the farther away \
     it is. A network also predicts the standard deviation (σ) of its answer.",
);
/// Learning from the expert's drives.
pub const BC: Term =
    term("bc", "BC, behaviour cloning", "A network trained only on drives of the expert. DAgger begins with it.");
/// Learning from the network's own mistakes.
pub const DAGGER: Term = term(
    "dagger",
    "DAgger, dataset aggregation",
    "In each iteration i the network drives, the expert labels what the network saw and takes over where the situation \
     is unsafe. The network is then trained on all samples so far.",
);
/// How much the network drove.
pub const ETA_HAT: Term = term(
    "eta-hat",
    "η̂",
    "The share of the ticks of an iteration in which the network drove. The iterations end once it exceeds the threshold \
     η.",
);
/// How far network and expert are apart.
pub const DISCREPANCY: Term = term(
    "discrepancy",
    "Discrepancy τ̂",
    "The distance between the look-ahead points of network and expert, in fractions of the side of the grid.",
);
/// The threshold beyond which the expert takes over.
pub const TAU: Term = term("tau", "τ", "The threshold of the discrepancy: above it, the expert drives.");
/// How unsure the network is.
pub const DOUBT: Term = term(
    "doubt",
    "Doubt χ̂",
    "The standard deviation that the network predicts for its answer. Above a threshold of its own, the expert drives.",
);
/// Errors of the segmentation.
pub const NOISE: Term = term(
    "noise",
    "Noise paper",
    "What the simulated camera gets wrong: shifted boundaries, shadows, blobs, missed obstacles, dropped frames. The \
     level paper imitates the errors in the figures of the paper; clean has none; other levels are multiples of paper.",
);

/// Every term, in the order of a glossary.
pub const ALL: [Term; 12] = [
    NEAR_COLLISION,
    CONTACT,
    LEAST_CLEARANCE,
    SAFE_RATIO,
    LOOK_AHEAD_POINT,
    BC,
    DAGGER,
    ETA_HAT,
    DISCREPANCY,
    TAU,
    DOUBT,
    NOISE,
];

impl Term {
    /// Markdown that leads to the glossary and shows the definition as a tooltip.
    pub fn link(&self, words: &str) -> String {
        format!("[{words}](#{} \"{}\")", self.slug, self.definition)
    }

    /// Its anchor.
    pub fn slug(&self) -> &'static str {
        self.slug
    }
}

/// Adds the glossary to a page.
pub fn add(page: &mut Page) {
    let mut text = String::new();
    for Term { slug, name, definition } in ALL {
        let _ = write!(text, "<a id=\"{slug}\"></a>**{name}.** {definition}\n\n");
    }
    page.section("Glossary", text);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_link_leads_to_its_term_and_shows_its_definition() {
        let mut page = Page::new("x");
        let links: Vec<String> = ALL.iter().map(|term| term.link("word")).collect();
        page.text(links.join(", "));
        add(&mut page);
        let html = page.to_html();
        for term in ALL {
            assert!(!term.definition.contains('"') && !term.definition.contains("  "), "{}", term.name);
            let link = format!("<a href=\"#{}\" title=\"{}", term.slug, &term.definition[..20]);
            assert_eq!(html.matches(&link).count(), 1, "{}", term.name);
            assert_eq!(html.matches(&format!("<a id=\"{}\"></a>", term.slug)).count(), 1, "{}", term.name);
        }
    }
}
