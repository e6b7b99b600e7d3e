//! Photometric web: luminous intensity over two angles.

/// Tolerance of angles in a file, degrees.
const TOLERANCE: f64 = 1e-3;

/// Luminous intensity of a luminaire at the crossings of its angles, between which it is linear.
///
/// In the luminaire's frame, intensity at both angles 0 goes along -z. Type C measures gamma, 0 to 180
/// degrees, from there and C about it, from +x towards +y. Of types B and A the vertical angle lies in the
/// plane of z and x, and the horizontal one is positive towards -y (CIE 121; `EXT_lights_ies`).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Web {
    kind: Kind,
    symmetry: Symmetry,
    /// Horizontal angles (planes), degrees, ascending.
    horizontal: Vec<f64>,
    /// Vertical angles, degrees, ascending.
    vertical: Vec<f64>,
    /// Intensities, cd, by horizontal and then by vertical angle.
    candelas: Vec<f64>,
}

/// System of planes in which a luminaire was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Planes about the axis of aim.
    C,
    /// Planes about a horizontal axis, of floodlights.
    B,
    /// Planes about a vertical axis, of headlamps.
    A,
}

/// Horizontal angles that are measured, of those that the others follow from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Symmetry {
    /// One plane is all.
    Axial,
    /// 0 to 90 of 0 to 360 degrees.
    Quadrants,
    /// 0 to 180 of 0 to 360 degrees.
    Halves,
    /// 90 to 270 of 0 to 360 degrees.
    HalvesFrom90,
    /// All planes of type C.
    None,
    /// Types A and B: 0 to 90 of -90 to 90 degrees, of horizontal and vertical angles.
    Mirrored([bool; 2]),
}

impl Web {
    /// Creates a web of `horizontal.len() * vertical.len()` intensities.
    ///
    /// # Errors
    /// The reason, if the angles are not those of a web of this kind.
    pub(super) fn new(
        kind: Kind,
        horizontal: Vec<f64>,
        vertical: Vec<f64>,
        candelas: Vec<f64>,
    ) -> Result<Self, String> {
        for (name, angles) in [("vertical", &vertical), ("horizontal", &horizontal)] {
            if let Some(pair) = angles.windows(2).find(|pair| pair[0] >= pair[1]) {
                return Err(format!("{name} angle {} comes after {}", pair[1], pair[0]));
            }
        }
        let symmetry = match kind {
            Kind::C => of_planes(&horizontal, &vertical)?,
            Kind::B | Kind::A => mirrored(&horizontal, &vertical)?,
        };
        Ok(Self { kind, symmetry, horizontal, vertical, candelas })
    }

    /// Greatest intensity, cd.
    pub(super) fn peak(&self) -> f64 {
        self.candelas.iter().copied().fold(0.0, f64::max)
    }

    /// Returns whether the intensity is equal in all planes of type C.
    pub(super) fn is_axial(&self) -> bool {
        self.symmetry == Symmetry::Axial
    }

    /// Angles of type C that a table of the web has to have, degrees: C and gamma. Of other types, none.
    pub(super) fn angles(&self) -> [&[f64]; 2] {
        match self.kind {
            Kind::C => [&self.horizontal, &self.vertical],
            Kind::B | Kind::A => [&[], &[]],
        }
    }

    /// Limits of gamma at which the intensity of type C breaks off, if it does by more than `share` of the
    /// peak.
    pub(super) fn edges(&self, share: f64) -> Vec<f64> {
        if self.kind != Kind::C {
            return Vec::new();
        }
        let ends = [(0, 0.0), (self.vertical.len() - 1, 180.0)];
        let breaks = ends.into_iter().filter(|&(index, end)| {
            let mut values = (0..self.horizontal.len()).map(|plane| self.value(plane, index));
            (self.vertical[index] - end).abs() > TOLERANCE && values.any(|value| value > share * self.peak())
        });
        breaks.map(|(index, _)| self.vertical[index]).collect()
    }

    /// Intensity, cd, at angles C and gamma of type C, degrees.
    pub(super) fn at(&self, c: f64, gamma: f64) -> f64 {
        let [horizontal, vertical] = match self.kind {
            Kind::C => [self.folded(c), gamma],
            Kind::B | Kind::A => self.of_other_planes(c, gamma),
        };
        let (Some(plane), Some(row)) = (self.plane(horizontal), between(&self.vertical, vertical)) else {
            return 0.0;
        };
        let along = |plane: usize| {
            let [low, high] = row.indices.map(|index| self.value(plane, index));
            low + (high - low) * row.share
        };
        let [low, high] = plane.indices.map(along);
        low + (high - low) * plane.share
    }

    fn value(&self, plane: usize, row: usize) -> f64 {
        self.candelas.get(plane * self.vertical.len() + row).copied().unwrap_or(0.0)
    }

    /// Angle C within the measured planes.
    fn folded(&self, c: f64) -> f64 {
        let c = c.rem_euclid(360.0);
        let half = if c > 180.0 { 360.0 - c } else { c };
        match self.symmetry {
            Symmetry::Axial => self.horizontal[0],
            Symmetry::Quadrants => half.min(180.0 - half),
            Symmetry::Halves => half,
            Symmetry::HalvesFrom90 if c < 90.0 => 180.0 - c,
            Symmetry::HalvesFrom90 if c > 270.0 => 540.0 - c,
            Symmetry::HalvesFrom90 | Symmetry::None | Symmetry::Mirrored(_) => c,
        }
    }

    /// Horizontal and vertical angle of type A or B of the direction at C and gamma.
    fn of_other_planes(&self, c: f64, gamma: f64) -> [f64; 2] {
        let (sine, cosine) = libm::sincos(gamma.to_radians());
        let (y, x) = libm::sincos(c.to_radians());
        let [x, y, aim] = [sine * x, sine * y, cosine];
        let [horizontal, vertical] = match self.kind {
            Kind::A => [libm::atan2(-y, aim), libm::asin(x.clamp(-1.0, 1.0))],
            Kind::B | Kind::C => [libm::asin((-y).clamp(-1.0, 1.0)), libm::atan2(x, aim)],
        };
        let Symmetry::Mirrored(is_mirrored) = self.symmetry else { return [horizontal, vertical] };
        let folded = |angle: f64, is_mirrored: bool| if is_mirrored { angle.abs() } else { angle };
        [folded(horizontal, is_mirrored[0]), folded(vertical, is_mirrored[1])].map(f64::to_degrees)
    }

    /// Planes on both sides of a horizontal angle.
    fn plane(&self, angle: f64) -> Option<Between> {
        let last = self.horizontal.len() - 1;
        let is_whole = self.symmetry == Symmetry::None && self.horizontal[last] < 360.0 - TOLERANCE;
        if is_whole && !(self.horizontal[0]..=self.horizontal[last]).contains(&angle) {
            let gap = self.horizontal[0] + 360.0 - self.horizontal[last];
            let into = (angle - self.horizontal[last]).rem_euclid(360.0);
            return Some(Between { indices: [last, 0], share: (into / gap).min(1.0) });
        }
        between(&self.horizontal, angle)
    }
}

fn is(angle: f64, expected: f64) -> bool {
    (angle - expected).abs() <= TOLERANCE
}

/// Symmetry of planes of type C.
fn of_planes(horizontal: &[f64], vertical: &[f64]) -> Result<Symmetry, String> {
    let (first, last) = (horizontal[0], horizontal[horizontal.len() - 1]);
    let [top, bottom] = [vertical[0], vertical[vertical.len() - 1]];
    if top < -TOLERANCE || bottom > 180.0 + TOLERANCE {
        return Err(format!("vertical angles {top} to {bottom} are not within 0 to 180"));
    }
    if horizontal.len() == 1 {
        return Ok(Symmetry::Axial);
    }
    if is(first, 90.0) && is(last, 270.0) {
        return Ok(Symmetry::HalvesFrom90);
    }
    match last {
        _ if !is(first, 0.0) => Err(format!("horizontal angles begin at {first}, not at 0 or 90")),
        last if is(last, 90.0) => Ok(Symmetry::Quadrants),
        last if is(last, 180.0) => Ok(Symmetry::Halves),
        last if last > 180.0 && last <= 360.0 + TOLERANCE => Ok(Symmetry::None),
        _ => Err(format!("horizontal angles end at {last}, not at 90, 180 or 360")),
    }
}

/// Symmetry of planes of type A or B.
fn mirrored(horizontal: &[f64], vertical: &[f64]) -> Result<Symmetry, String> {
    let mirrored = |name: &str, angles: &[f64]| {
        let [first, last] = [angles[0], angles[angles.len() - 1]];
        if first < -90.0 - TOLERANCE || last > 90.0 + TOLERANCE {
            return Err(format!("{name} angles {first} to {last} are not within -90 to 90"));
        }
        Ok(first >= -TOLERANCE)
    };
    Ok(Symmetry::Mirrored([mirrored("horizontal", horizontal)?, mirrored("vertical", vertical)?]))
}

/// Place between two ascending angles.
struct Between {
    indices: [usize; 2],
    /// Weight of the second.
    share: f64,
}

/// Place of an angle among ascending ones; `None` outside.
fn between(angles: &[f64], angle: f64) -> Option<Between> {
    let (first, last) = (*angles.first()?, *angles.last()?);
    if angle < first - TOLERANCE || angle > last + TOLERANCE {
        return None;
    }
    let high = angles.partition_point(|&other| other <= angle).clamp(1, angles.len().max(2) - 1);
    if angles.len() == 1 {
        return Some(Between { indices: [0, 0], share: 0.0 });
    }
    let (low, high) = (high - 1, high);
    let share = ((angle - angles[low]) / (angles[high] - angles[low])).clamp(0.0, 1.0);
    Some(Between { indices: [low, high], share })
}
