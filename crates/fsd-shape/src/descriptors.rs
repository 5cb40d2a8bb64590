//! Fourier shape descriptors of a closed outline (Eqs. 1–3), and transformations of them.

use portable_numerics::fourier::LaneFft;

use crate::Error;
use crate::outline::{Point, signed_area};

/// Minimum number of points of an outline.
const MIN_POINTS: usize = 3;

/// Fourier shape descriptors u₋ₕ … u₀ … uₕ of a closed outline, Eq. 2.
///
/// A point (x, y) is the complex number z = x + iy (Eq. 1), given here as `[x, y]`. The outline is the curve
/// z(t) = Σ uₗ e^{i2πlt}, 0 ≤ t < 1: u₀ is its centre, u₁ a circle in
/// the direction of positive area, u₋₁ changes it to an ellipse, and higher |l| are finer detail.
///
/// # Differences from the paper
///
/// The index l is signed: the paper's u_{K−l} is u₋ₗ here. For an even number K of points, the descriptor u_{K/2} is
/// divided equally between l = K/2 and −K/2; the outline at the K points is the same, and smoother between them.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Vec<Point>", into = "Vec<Point>"))]
pub struct Descriptors {
    /// u₋ₕ … uₕ: an odd number of them.
    terms: Vec<Point>,
}

impl Descriptors {
    /// Computes all descriptors (|l| ≤ K/2) of an outline of K points, Eq. 2.
    ///
    /// The points count as equidistant in the parameter of the curve. Use [`crate::resample`] first to parametrise by
    /// arc length, as in the paper.
    ///
    /// # Errors
    ///
    /// If there are fewer than 3 points, a point is not finite, or they enclose no area.
    pub fn from_outline(outline: &[Point]) -> Result<Self, Error> {
        let count = outline.len();
        if count < MIN_POINTS {
            return Err(Error::TooFewPoints { count, needed: MIN_POINTS });
        }
        if let Some(index) = outline.iter().position(|p| !p.iter().all(|v| v.is_finite())) {
            return Err(Error::PointValue { index });
        }
        if signed_area(outline) == 0.0 {
            return Err(Error::NoArea);
        }
        // Eq. 2: uₗ = (1/K) Σₖ z(k) e^{−i2πlk/K}, with z(k) = x(k) + iy(k) (Eq. 1).
        let sums = LaneFft::new(count).forward(outline);
        let half = count / 2;
        let halved = if count.is_multiple_of(2) { half } else { half + 1 };
        let terms = (0..=2 * half)
            .map(|index| {
                let bin = (index + count - half) % count;
                let divisor = if index.abs_diff(half) == halved { 2.0 } else { 1.0 };
                sums[bin].map(|v| v / (divisor * count as f64))
            })
            .collect();
        Ok(Self { terms })
    }

    /// Creates descriptors from the terms u₋ₕ … u₀ … uₕ.
    ///
    /// # Errors
    ///
    /// If their number is even or below 3, or a term is not finite.
    pub fn from_harmonics(terms: Vec<Point>) -> Result<Self, Error> {
        if terms.len() < MIN_POINTS || terms.len().is_multiple_of(2) {
            return Err(Error::Parameter {
                field: "number of descriptors",
                value: terms.len() as f64,
                accepted: "an odd number of at least 3 (l from -h to h)",
            });
        }
        match terms.iter().position(|u| !u.iter().all(|v| v.is_finite())) {
            Some(index) => Err(Error::PointValue { index }),
            None => Ok(Self { terms }),
        }
    }

    /// Returns the highest |l|.
    pub fn harmonics(&self) -> usize {
        self.terms.len() / 2
    }

    /// Returns uₗ as `[re, im]`; 0 beyond [`Self::harmonics`].
    pub fn harmonic(&self, l: i32) -> [f64; 2] {
        let centre = i64::try_from(self.harmonics()).unwrap_or(i64::MAX);
        usize::try_from(centre + i64::from(l))
            .ok()
            .and_then(|index| self.terms.get(index).copied())
            .unwrap_or([0.0, 0.0])
    }

    /// Returns |uₗ|.
    pub fn magnitude(&self, l: i32) -> f64 {
        modulus(self.harmonic(l))
    }

    /// Returns the size |u₁|, in px: the radius of a circle, the mean of the semi-axes of an ellipse.
    pub fn radius(&self) -> f64 {
        self.magnitude(1)
    }

    /// Returns the area enclosed by the continuous curve, π Σ l |uₗ|², in px²; positive in the orientation of
    /// [`crate::trace`].
    pub fn area(&self) -> f64 {
        let sum: f64 = self.indexed().map(|(l, u)| l * (u[0] * u[0] + u[1] * u[1])).sum();
        core::f64::consts::PI * sum
    }

    /// Returns the curve at `count` equidistant parameters: the inverse of Eq. 2, at any number of points.
    ///
    /// ```
    /// use fsd_shape::Descriptors;
    /// let triangle = [[0.0, 0.0], [6.0, 0.0], [0.0, 6.0]];
    /// let descriptors = Descriptors::from_outline(&triangle)?;
    /// for (p, q) in descriptors.outline(3).iter().zip(&triangle) {
    ///     assert!((p[0] - q[0]).abs() < 1e-12 && (p[1] - q[1]).abs() < 1e-12);
    /// }
    /// assert_eq!(descriptors.outline(100).len(), 100);
    /// # Ok::<(), fsd_shape::Error>(())
    /// ```
    pub fn outline(&self, count: usize) -> Vec<Point> {
        if count == 0 {
            return Vec::new();
        }
        // z(k) = Σₗ uₗ e^{i2πlk/K}; e^{i2πlk/K} depends only on l mod K, so terms with equal l mod K are added.
        let mut bins = vec![[0.0, 0.0]; count];
        let first = count - self.harmonics() % count;
        for (index, u) in self.terms.iter().enumerate() {
            let bin = &mut bins[(first + index) % count];
            *bin = [bin[0] + u[0], bin[1] + u[1]];
        }
        LaneFft::new(count).inverse(&bins)
    }

    /// Returns the terms with |l| ≤ `harmonics` (at least 1): a smoother outline.
    #[must_use]
    pub fn truncated(&self, harmonics: usize) -> Self {
        let drop = self.harmonics().saturating_sub(harmonics.max(1));
        Self { terms: self.terms[drop..self.terms.len() - drop].to_vec() }
    }

    /// Returns the shape without position and size, Eq. 3: ûₗ = uₗ / |u₁| and û₀ = 0.
    ///
    /// A curve without a first harmonic is only centred.
    #[must_use]
    pub fn normalised(&self) -> Self {
        let radius = self.radius();
        // Eq. 3: 1 / |u₁|.
        let scale = if radius > 0.0 { 1.0 / radius } else { 1.0 };
        let centre = self.harmonics();
        let mut scaled = self.scaled(scale);
        scaled.terms[centre] = [0.0, 0.0];
        scaled
    }

    /// Returns the shape in a standard pose: rotation and start point are such that u₁ and u₋₁ are real and not
    /// negative. Of the two possible poses, which differ by half a turn, it is the one with Re u₂ ≥ 0.
    ///
    /// Outlines that differ only by start point and rotation about the origin become equal.
    #[must_use]
    pub fn aligned(&self) -> Self {
        let argument = |u: Point| libm::atan2(u[1], u[0]);
        let (forth, back) = (argument(self.harmonic(1)), argument(self.harmonic(-1)));
        let (angle, start) = (-(forth + back) / 2.0, -(forth - back) / 2.0);
        let mut posed = self.map(|l, u| multiply(u, unit(angle + l * start)));
        if posed.harmonic(2)[0] < 0.0 {
            // Half a turn of rotation and start point: (−1)^{l+1}.
            let centre = self.harmonics();
            for (index, u) in posed.terms.iter_mut().enumerate() {
                if index.abs_diff(centre).is_multiple_of(2) {
                    *u = [-u[0], -u[1]];
                }
            }
        }
        let centre = self.harmonics();
        for index in [centre - 1, centre + 1] {
            // Real by construction, up to rounding errors.
            posed.terms[index] = [modulus(self.terms[index]), 0.0];
        }
        posed
    }

    /// Returns the shape rotated about the origin by `rad`, from x towards y (clockwise on the screen): e^{iφ} uₗ.
    #[must_use]
    pub fn rotated(&self, rad: f64) -> Self {
        let turn = unit(rad);
        self.map(|_, u| multiply(u, turn))
    }

    /// Returns the shape scaled about the origin: s uₗ.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        self.map(|_, u| [factor * u[0], factor * u[1]])
    }

    /// Returns the shape translated by `offset`: u₀ + offset.
    #[must_use]
    pub fn translated(&self, offset: Point) -> Self {
        let mut moved = self.clone();
        let centre = &mut moved.terms[self.harmonics()];
        *centre = [centre[0] + offset[0], centre[1] + offset[1]];
        moved
    }

    /// Returns the curve with its start point moved to the parameter `fraction`, from 0 to 1: e^{i2πl·fraction} uₗ.
    #[must_use]
    pub fn shifted(&self, fraction: f64) -> Self {
        self.map(|l, u| multiply(u, unit(core::f64::consts::TAU * l * fraction)))
    }

    /// Returns the curve in the opposite direction from the same start point: u₋ₗ. The area changes sign.
    #[must_use]
    pub fn reversed(&self) -> Self {
        Self { terms: self.terms.iter().rev().copied().collect() }
    }

    /// Returns the mirror image, y to −y: the conjugate of u₋ₗ. The area changes sign; [`Self::reversed`] restores it.
    #[must_use]
    pub fn reflected(&self) -> Self {
        let mut mirrored = self.reversed();
        for u in &mut mirrored.terms {
            u[1] = -u[1];
        }
        mirrored
    }

    /// Returns the terms with their indices l.
    pub(crate) fn indexed(&self) -> impl Iterator<Item = (f64, Point)> + '_ {
        let centre = self.harmonics() as f64;
        self.terms.iter().enumerate().map(move |(index, &u)| (index as f64 - centre, u))
    }

    fn map(&self, change: impl Fn(f64, Point) -> Point) -> Self {
        Self { terms: self.indexed().map(|(l, u)| change(l, u)).collect() }
    }

    /// Returns the terms u₋ₕ … uₕ.
    pub fn as_slice(&self) -> &[Point] {
        &self.terms
    }
}

impl TryFrom<Vec<Point>> for Descriptors {
    type Error = Error;

    fn try_from(terms: Vec<Point>) -> Result<Self, Error> {
        Self::from_harmonics(terms)
    }
}

impl From<Descriptors> for Vec<Point> {
    fn from(descriptors: Descriptors) -> Self {
        descriptors.terms
    }
}

pub(crate) fn modulus(u: Point) -> f64 {
    (u[0] * u[0] + u[1] * u[1]).sqrt()
}

/// Returns the product of two complex numbers.
pub(crate) fn multiply(a: Point, b: Point) -> Point {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

/// Returns e^{iφ}.
pub(crate) fn unit(phi: f64) -> Point {
    let (sin, cos) = libm::sincos(phi);
    [cos, sin]
}
