//! Sine and its kin, the same to the bit on every platform.
//!
//! `f32::sin` asks the platform's library, and those differ: glibc from musl, one version of glibc from the next, a CPU
//! with fused multiplication from one without. These are the functions of the crate `libm`, compiled from Rust. What is
//! exact everywhere (`+ − × ÷`, square root, rounding, remainder) is used as it comes. Clippy refuses the others
//! (`disallowed-methods` in `.clippy.toml`); for 64 bits, call `libm`.

use glam::Vec2;

/// Sine of an angle in radians.
#[inline]
pub fn sin(angle_rad: f32) -> f32 {
    libm::sinf(angle_rad)
}

/// Cosine of an angle in radians.
#[inline]
pub fn cos(angle_rad: f32) -> f32 {
    libm::cosf(angle_rad)
}

/// Sine and cosine of an angle in radians.
#[inline]
pub fn sin_cos(angle_rad: f32) -> (f32, f32) {
    libm::sincosf(angle_rad)
}

/// Tangent of an angle in radians.
#[inline]
pub fn tan(angle_rad: f32) -> f32 {
    libm::tanf(angle_rad)
}

/// Arcsine in −π/2…π/2; NaN outside −1…1.
#[inline]
pub fn asin(sine: f32) -> f32 {
    libm::asinf(sine)
}

/// Arccosine in 0…π; NaN outside −1…1.
#[inline]
pub fn acos(cosine: f32) -> f32 {
    libm::acosf(cosine)
}

/// Arctangent in −π/2…π/2.
#[inline]
pub fn atan(tangent: f32) -> f32 {
    libm::atanf(tangent)
}

/// Angle of the point (x, y), in −π…π. The order of the arguments is that of [`f32::atan2`].
#[inline]
pub fn atan2(y: f32, x: f32) -> f32 {
    libm::atan2f(y, x)
}

/// e to the power of `exponent`.
#[inline]
pub fn exp(exponent: f32) -> f32 {
    libm::expf(exponent)
}

/// Natural logarithm.
#[inline]
pub fn ln(value: f32) -> f32 {
    libm::logf(value)
}

/// Hyperbolic tangent.
#[inline]
pub fn tanh(value: f32) -> f32 {
    libm::tanhf(value)
}

/// `base` to the power of `exponent`.
#[inline]
pub fn pow(base: f32, exponent: f32) -> f32 {
    libm::powf(base, exponent)
}

/// √(x² + y²), for distances: too large from 10¹⁹ on, where [`f32::hypot`] still is right.
#[inline]
pub fn hypot(x: f32, y: f32) -> f32 {
    (x * x + y * y).sqrt()
}

/// The unit vector at an angle, counter-clockwise from x, radians.
#[inline]
pub fn unit(angle_rad: f32) -> Vec2 {
    let (sin, cos) = sin_cos(angle_rad);
    Vec2::new(cos, sin)
}

/// Angle of a vector, counter-clockwise from x, in −π…π.
#[inline]
pub fn angle_rad(vector: Vec2) -> f32 {
    atan2(vector.y, vector.x)
}
