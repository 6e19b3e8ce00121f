//! Three-vectors over any [`Real`], with only the operations that rigid bodies need.

use std::ops::{Add, AddAssign, Mul, Sub};

use super::real::Real;

/// A three-vector; the code that holds it states its frame.
#[derive(Debug, Clone, Copy)]
pub struct Vec3<T> {
    /// Component along x.
    pub x: T,
    /// Component along y.
    pub y: T,
    /// Component along z.
    pub z: T,
}

impl<T: Real> Vec3<T> {
    /// From components.
    #[inline(always)]
    pub fn new(x: T, y: T, z: T) -> Self {
        Self { x, y, z }
    }

    /// The same constant vector in every lane.
    #[inline(always)]
    pub fn constant(v: [f64; 3]) -> Self {
        Self::new(T::constant(v[0]), T::constant(v[1]), T::constant(v[2]))
    }

    /// The zero vector.
    #[inline(always)]
    pub fn zero() -> Self {
        Self::constant([0.0; 3])
    }

    /// `self · o`.
    #[inline(always)]
    pub fn dot(self, o: Self) -> T {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    /// `self × o`.
    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        Self::new(
            self.y * o.z - self.z * o.y,
            self.z * o.x - self.x * o.z,
            self.x * o.y - self.y * o.x,
        )
    }

    /// `self × o` for a constant `o`.
    #[inline(always)]
    pub fn cross_constant(self, o: [f64; 3]) -> Self {
        Self::new(
            self.y * o[2] - self.z * o[1],
            self.z * o[0] - self.x * o[2],
            self.x * o[1] - self.y * o[0],
        )
    }
}

impl<T: Real> Add for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self::new(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl<T: Real> AddAssign for Vec3<T> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl<T: Real> Sub for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self::new(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl<T: Real> Mul<T> for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, k: T) -> Self {
        Self::new(self.x * k, self.y * k, self.z * k)
    }
}
