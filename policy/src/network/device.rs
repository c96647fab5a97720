//! Where a network is computed.

use burn::tensor::Device;
use serde::{Deserialize, Serialize};

/// Where the network is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeviceChoice {
    /// [`fast`](crate::network::fast), on all threads of the current rayon pool.
    #[default]
    Cpu,
    /// burn's CPU backend: the reference, slower.
    Flex,
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
    /// The burn device, or `None` for [`fast`](crate::network::fast).
    pub(crate) fn burn_device(self) -> Option<Device> {
        match self {
            Self::Cpu => None,
            Self::Flex => Some(Device::flex()),
            #[cfg(feature = "cuda")]
            Self::Cuda => Some(Device::cuda(0)),
            #[cfg(feature = "wgpu")]
            Self::Wgpu => Some(Device::wgpu(burn::tensor::DeviceKind::DefaultDevice)),
            #[cfg(feature = "vulkan")]
            Self::Vulkan => Some(Device::vulkan(burn::tensor::DeviceKind::DefaultDevice)),
        }
    }
}
