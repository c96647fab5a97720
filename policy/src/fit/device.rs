//! Where a network is trained.

use burn::tensor::Device;
use serde::{Deserialize, Serialize};

/// Where the network is trained. Wherever that is, trained networks answer on CPUs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeviceChoice {
    /// burn's CPU backend with the operations of [`operations`](crate::network::operations), on all threads of the
    /// current rayon pool.
    #[default]
    Cpu,
    /// First CUDA device.
    #[cfg(feature = "cuda")]
    Cuda,
    /// Default device of wgpu with WGSL shaders.
    #[cfg(feature = "wgpu")]
    Wgpu,
    /// Default device of wgpu with SPIR-V shaders.
    #[cfg(feature = "vulkan")]
    Vulkan,
}

impl DeviceChoice {
    /// The device of burn.
    pub fn device(self) -> Device {
        match self {
            Self::Cpu => Device::flex(),
            #[cfg(feature = "cuda")]
            Self::Cuda => Device::cuda(0),
            #[cfg(feature = "wgpu")]
            Self::Wgpu => Device::wgpu(burn::tensor::DeviceKind::DefaultDevice),
            #[cfg(feature = "vulkan")]
            Self::Vulkan => Device::vulkan(burn::tensor::DeviceKind::DefaultDevice),
        }
    }
}
