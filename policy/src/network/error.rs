//! Why a network is refused.

/// Why a network shape is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NetworkError {
    /// The vector width of the first convolution.
    #[error("{layer} has {channels} channels; the arithmetic wants a positive multiple of {multiple}")]
    Channels {
        /// Which convolution.
        layer: &'static str,
        /// What was asked for.
        channels: usize,
        /// What is possible.
        multiple: usize,
    },
    /// The kernel does not fit the tables of the first convolution.
    #[error("{layer} has a kernel of {kernel} cells; 1 to 7 are possible")]
    Kernel {
        /// Which convolution.
        layer: &'static str,
        /// What was asked for.
        kernel: usize,
    },
    /// A fully connected layer without units.
    #[error("the fully connected layer needs at least one unit")]
    NoHiddenUnits,
    /// No mode or too many.
    #[error("the network cannot answer with {modes} modes; 1 to {max} are possible")]
    Modes {
        /// How many there would be.
        modes: usize,
        /// What is possible.
        max: usize,
    },
    /// More than the arithmetic has room for.
    #[error("the network would have {what}; at most {max} are possible")]
    TooLarge {
        /// What there is too much of, with its number.
        what: String,
        /// What is possible.
        max: usize,
    },
    /// A smoothing that has no time constant.
    #[error("smoothing_ticks is {ticks}; 0 or more ticks are possible")]
    Smoothing {
        /// What was asked for.
        ticks: f32,
    },
    /// A share outside [0, 1).
    #[error("{name} is {share}; a share from 0 to below 1 is possible")]
    Dropout {
        /// Which layer.
        name: &'static str,
        /// What was asked for.
        share: f32,
    },
}
