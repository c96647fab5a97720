//! Every method by name: its parameters as one type, its planners as another.

use crate::context::PlannerContext;
use crate::explanation::Explanation;
use crate::method::Method;
use crate::{apf, cvm, dwa, mppi, search, tentacle, vff, vvf};
use serde::{Deserialize, Deserializer};
use sim::driver::{Decision, Policy};
use sim::sensing::Observation;

/// Writes a number as people would: TOML's floats are f64, and 2.3 as f32 is 2.299999952316284 as f64.
fn shorten(value: &mut toml::Value) {
    if let toml::Value::Float(number) = value
        && let Ok(short) = (*number as f32).to_string().parse()
    {
        *number = short;
    }
}

macro_rules! planners {
    ($($variant:ident $module:ident,)*) => {
        /// A method with its parameters.
        #[derive(Debug, Clone, PartialEq)]
        pub enum PlannerSpec {
            $(#[doc = concat!("See [`", stringify!($module), "`].")] $variant($module::Params),)*
        }

        /// A planner at the wheel, with its tables and its memory.
        #[derive(Debug, Clone)]
        pub enum Planner {
            $(#[doc = concat!("See [`", stringify!($module), "`].")] $variant(<$module::Params as Method>::Planner),)*
        }

        impl PlannerSpec {
            /// Every method with the paper's or the literature's parameters.
            pub fn all() -> Vec<Self> {
                vec![$(Self::$variant($module::Params::paper()),)*]
            }

            /// Every method, and after it every other reading of it, as named on the command line.
            pub fn in_every_reading() -> Vec<(String, Self)> {
                let readings = |spec: Self| {
                    let others = spec.readings().into_iter();
                    let others = others.map(|(reading, _, read)| (format!("{}/{reading}", spec.name()), read));
                    let others: Vec<(String, Self)> = others.collect();
                    std::iter::once((spec.name().to_owned(), spec)).chain(others)
                };
                Self::all().into_iter().flat_map(readings).collect()
            }

            /// A method by its name, or another reading of it as `NAME/READING`.
            pub fn named(name: &str) -> Option<Self> {
                let (method, reading) = name.split_once('/').map_or((name, None), |(of, reading)| (of, Some(reading)));
                let spec = Self::all().into_iter().find(|spec| spec.name() == method)?;
                let Some(reading) = reading else { return Some(spec) };
                spec.readings().into_iter().find(|(of, ..)| *of == reading).map(|(_, _, read)| read)
            }

            /// As named on the command line.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$variant(_) => <$module::Params as Method>::NAME,)* }
            }

            /// One line.
            pub fn about(&self) -> &'static str {
                match self { $(Self::$variant(_) => <$module::Params as Method>::ABOUT,)* }
            }

            /// Other readings of the publication: name, what is different, and the method so read.
            pub fn readings(&self) -> Vec<(&'static str, &'static str, Self)> {
                match self {
                    $(Self::$variant(_) => {
                        let readings = $module::Params::READINGS.iter();
                        readings.map(|of| (of.name, of.about, Self::$variant((of.params)()))).collect()
                    })*
                }
            }

            /// Whether a planner can be made of these parameters.
            ///
            /// # Errors
            /// Naming the parameter that is out of range.
            pub fn check(&self) -> Result<(), String> {
                match self { $(Self::$variant(params) => params.check(),)* }
            }

            /// A planner for a car. Making one takes milliseconds (tables); clones share them.
            pub fn planner(&self, context: &PlannerContext) -> Planner {
                match self { $(Self::$variant(params) => Planner::$variant(params.planner(context)),)* }
            }

            /// The same method with parameters from a file, all of them and no others; not checked for range.
            ///
            /// # Errors
            /// If one is missing, unknown or of another type.
            pub fn with_parameters<'de, D: Deserializer<'de>>(&self, parameters: D) -> Result<Self, D::Error> {
                match self {
                    $(Self::$variant(_) => $module::Params::deserialize(parameters).map(Self::$variant),)*
                }
            }

            /// The parameters as TOML.
            ///
            /// # Panics
            /// Never: parameters are plain values.
            pub fn parameters(&self) -> toml::Table {
                let table = match self { $(Self::$variant(params) => toml::Table::try_from(params),)* };
                let mut table = table.expect("parameters are plain values");
                table.iter_mut().for_each(|(_, value)| shorten(value));
                table
            }

            /// Names and spans of what the tuner varies.
            pub fn search_space(&self) -> Vec<(&'static str, search::Span)> {
                match self {
                    $(Self::$variant(_) => $module::Params::SEARCH.iter().map(|d| (d.name, d.span)).collect(),)*
                }
            }

            /// Where these parameters lie in the search space, 0…1 per dimension.
            pub fn to_unit_cube(&self) -> Vec<f32> {
                match self {
                    $(Self::$variant(params) => {
                        $module::Params::SEARCH.iter().map(|d| d.span.to_unit((d.get)(params))).collect()
                    })*
                }
            }

            /// These parameters, those that the tuner varies moved to a point of the search space.
            ///
            /// # Panics
            /// If the point has another dimension.
            #[must_use]
            pub fn at(&self, unit_cube: &[f32]) -> Self {
                match self {
                    $(Self::$variant(params) => {
                        let mut params = params.clone();
                        assert_eq!(unit_cube.len(), $module::Params::SEARCH.len(), "one coordinate per dimension");
                        for (dimension, &unit) in $module::Params::SEARCH.iter().zip(unit_cube) {
                            (dimension.set)(&mut params, dimension.span.from_unit(unit));
                        }
                        Self::$variant(params)
                    })*
                }
            }
        }

        impl Policy for Planner {
            fn act(&mut self, observation: &Observation) -> Decision {
                match self { $(Self::$variant(planner) => planner.act(observation),)* }
            }

            fn reset(&mut self) {
                match self { $(Self::$variant(planner) => planner.reset(),)* }
            }
        }
    };
}

impl Planner {
    /// What was weighed in the last answer, which was to this observation; `None` for methods that do not say.
    pub fn explain(&self, observation: &Observation) -> Option<Explanation> {
        match self {
            Self::Tentacle(tentacles) => Some(Explanation::Paths(tentacles.weighed(&observation.grid))),
            Self::Vvf(field) => Some(Explanation::Field(field.sampled(&observation.grid))),
            Self::Apf(field) => Some(Explanation::Field(field.sampled(&observation.grid))),
            Self::Dwa(_) | Self::Cvm(_) | Self::Vff(_) | Self::Mppi(_) => None,
        }
    }
}

planners! {
    Tentacle tentacle,
    Vvf vvf,
    Dwa dwa,
    Cvm cvm,
    Apf apf,
    Vff vff,
    Mppi mppi,
}
