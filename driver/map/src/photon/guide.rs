//! Guiding of emission: warps the unit hypercube from which emission is sampled. Points whose paths store
//! photons that the picture uses are sampled more densely.
//!
//! The hypercube is halved repeatedly, each box along the dimension that best separates useful from useless
//! paths. A point is transformed by hierarchical sample warping (Clarberg et al. 2005, *Wavelet importance
//! sampling*): within a box, its coordinate along the split dimension is compared with the probability of the
//! lower half, and rescaled. Points that are stratified in each dimension therefore stay stratified.

/// Number of dimensions of the hypercube.
pub(super) const DIMENSIONS: usize = 4;
/// Point of the hypercube, in units of 2^-64.
pub(super) type Point = [u64; DIMENSIONS];

/// Fraction of the points that are uniformly distributed. Its inverse is an upper bound of the weights.
pub(super) const UNIFORM_SHARE: f64 = 0.25;
/// Minimum mean number of useful samples in the two halves of a box that is split.
const MIN_USEFUL: usize = 8;
/// Number of hypothetical samples that are added to a box's own samples. Their mean square use is that of the
/// enclosing box.
const PRIOR_SAMPLES: f64 = 4.0;
/// Maximum number of halvings along a dimension.
const MAX_HALVINGS: u32 = 20;
/// Number of values of a coordinate: 2^64.
const ALL: f64 = 18_446_744_073_709_551_616.0;
/// Largest `f64` below 1.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON / 2.0;

/// Point of the hypercube from which a path is emitted, and how much the picture uses the path's photons.
/// `use_of_path` and `squares` count the powers that the photons would have without guiding.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) point: Point,
    /// Sum of the uses of the path's photons.
    pub(super) use_of_path: f64,
    /// Sum of the squared uses of the path's photons. It is the variance that they add, because they lie in
    /// different places.
    pub(super) squares: f64,
    /// Weight of the point under the guide that sampled it ([`Warped::weight`]).
    pub(super) weight: f32,
}

/// A warped point and its weight: the density of uniform points divided by that of warped points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Warped {
    pub(super) point: Point,
    pub(super) weight: f32,
}

/// Division of the hypercube into boxes with probabilities.
#[derive(Clone, Debug)]
pub(super) struct Guide {
    /// Boxes, beginning with the whole hypercube. The lower half of a box follows the box directly.
    boxes: Vec<Region>,
    spread: f64,
    gain: f64,
}

/// A box of the hypercube.
#[derive(Clone, Copy, Debug)]
struct Region {
    /// Probability of the box.
    share: f64,
    halves: Option<Halves>,
}

#[derive(Clone, Copy, Debug)]
struct Halves {
    dimension: usize,
    /// Index of the upper half.
    upper: usize,
}

/// Sums over the samples in a box.
#[derive(Clone, Copy, Default)]
struct Sums {
    /// Number of samples whose paths store a photon that the picture uses.
    useful: usize,
    /// Sum of the samples' weights.
    weight: f64,
    /// Sum of the uses of the samples' paths, each times the sample's weight.
    uses: f64,
    /// Sum of the samples' squared uses, each times the sample's weight.
    squares: f64,
}

impl Sums {
    fn add(&mut self, sample: &Sample) {
        let Sample { use_of_path, squares, weight, .. } = *sample;
        let weight = f64::from(weight);
        self.useful += usize::from(squares > 0.0);
        self.weight += weight;
        self.uses += weight * use_of_path;
        self.squares += weight * squares;
    }

    fn of(samples: &[Sample]) -> Self {
        let mut sums = Self::default();
        samples.iter().for_each(|sample| sums.add(sample));
        sums
    }
}

impl Guide {
    /// Builds a guide from samples, and changes their order; `None` if none of them is useful.
    pub(super) fn new(samples: &mut [Sample]) -> Option<Self> {
        let all = Sums::of(samples);
        if !(all.squares > 0.0 && all.squares.is_finite()) {
            return None;
        }
        let mut builder = Builder { boxes: Vec::new(), uses: Vec::new() };
        let mean_square = all.squares / all.weight;
        let total = builder.divide(samples, [0; DIMENSIONS], 1.0, mean_square);
        let Builder { mut boxes, uses } = builder;
        let mut guided_use = 0.0;
        for (part, (volume, mean)) in boxes.iter_mut().zip(&uses) {
            part.share = UNIFORM_SHARE * volume + (1.0 - UNIFORM_SHARE) * part.share / total;
            if part.halves.is_none() {
                guided_use += part.share * mean;
            }
        }
        Some(Self { boxes, spread: total, gain: guided_use / (all.uses / all.weight) })
    }

    /// Expected use of a guided path divided by that of an unguided path, estimated from the samples.
    pub(super) fn gain(&self) -> f64 {
        self.gain
    }

    /// Root mean square, over guided paths, of a path's use times its weight.
    pub(super) fn spread(&self) -> f64 {
        self.spread
    }

    /// Number of boxes that are not split.
    pub(super) fn cells(&self) -> usize {
        self.boxes.iter().filter(|part| part.halves.is_none()).count()
    }

    /// Maps a uniform random point to one with the guide's density; its weight is `1 / density`.
    pub(super) fn warp(&self, point: Point) -> Warped {
        // Coordinates within the current box, 0 to 1.
        let mut inner = point.map(|coordinate| (coordinate as f64 / ALL).min(BELOW_ONE));
        let mut lower = [0.0; DIMENSIONS];
        let mut sides = [1.0; DIMENSIONS];
        let mut index = 0;
        while let Region { share, halves: Some(Halves { dimension, upper }) } = self.boxes[index] {
            let of_lower = self.boxes[index + 1].share / share;
            let at = inner[dimension];
            sides[dimension] *= 0.5;
            (inner[dimension], index) = if at < of_lower {
                (at / of_lower, index + 1)
            } else {
                lower[dimension] += sides[dimension];
                ((at - of_lower) / (1.0 - of_lower), upper)
            };
            inner[dimension] = inner[dimension].min(BELOW_ONE);
        }
        let volume: f64 = sides.iter().product();
        let point = std::array::from_fn(|dimension| {
            ((lower[dimension] + sides[dimension] * inner[dimension]) * ALL) as u64
        });
        Warped { point, weight: (volume / self.boxes[index].share) as f32 }
    }
}

/// Boxes of a [`Guide`] during its construction.
struct Builder {
    /// Boxes. The `share` of an undivided box is its volume times the root mean square use of its paths. This
    /// is proportional to the box's optimal probability.
    boxes: Vec<Region>,
    /// Volume and mean use of each box.
    uses: Vec<(f64, f64)>,
}

impl Builder {
    /// Adds a box and splits it further. `halvings` counts the halvings along each dimension; `mean_square`
    /// is the mean square use of the enclosing box. Returns the box's share.
    fn divide(
        &mut self,
        samples: &mut [Sample],
        halvings: [u32; DIMENSIONS],
        volume: f64,
        mean_square: f64,
    ) -> f64 {
        let sums = Sums::of(samples);
        let mean_square = (sums.squares + PRIOR_SAMPLES * mean_square) / (sums.weight + PRIOR_SAMPLES);
        let index = self.boxes.len();
        self.boxes.push(Region { share: volume * mean_square.sqrt(), halves: None });
        self.uses.push((volume, if sums.weight > 0.0 { sums.uses / sums.weight } else { 0.0 }));
        let Some(dimension) = best_dimension(samples, halvings) else { return self.boxes[index].share };
        let is_lower = |sample: &Sample| !is_upper(sample, dimension, halvings[dimension]);
        let (lower, upper) = partitioned(samples, is_lower);
        let mut finer = halvings;
        finer[dimension] += 1;
        let of_lower = self.divide(lower, finer, 0.5 * volume, mean_square);
        let halves = Some(Halves { dimension, upper: self.boxes.len() });
        let share = of_lower + self.divide(upper, finer, 0.5 * volume, mean_square);
        self.boxes[index] = Region { share, halves };
        share
    }
}

/// Returns whether a sample of a box is in the upper half along a dimension that was halved `halvings` times.
fn is_upper(sample: &Sample, dimension: usize, halvings: u32) -> bool {
    sample.point[dimension] >> (63 - halvings) & 1 == 1
}

/// Returns the dimension in which to split a box: that with the least sum of the optimal shares of the two
/// halves. Returns `None` if the box has too few useful samples to be split, or was halved too often.
fn best_dimension(samples: &[Sample], halvings: [u32; DIMENSIONS]) -> Option<usize> {
    if Sums::of(samples).useful < 2 * MIN_USEFUL {
        return None;
    }
    let cost = |dimension: usize| {
        let mut halves = [Sums::default(); 2];
        for sample in samples {
            halves[usize::from(is_upper(sample, dimension, halvings[dimension]))].add(sample);
        }
        halves.map(|half| (half.weight * half.squares).sqrt()).iter().sum::<f64>()
    };
    let open = (0..DIMENSIONS).filter(|&dimension| halvings[dimension] < MAX_HALVINGS);
    open.map(|dimension| (dimension, cost(dimension)))
        .min_by(|(_, a), (_, b)| a.total_cmp(b))
        .map(|(dimension, _)| dimension)
}

/// Moves the samples for which `is_first` is true to the front. Returns them and the others.
fn partitioned(samples: &mut [Sample], is_first: impl Fn(&Sample) -> bool) -> (&mut [Sample], &mut [Sample]) {
    let mut count = 0;
    for index in 0..samples.len() {
        if is_first(&samples[index]) {
            samples.swap(index, count);
            count += 1;
        }
    }
    samples.split_at_mut(count)
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::sampler::hash;

    use super::*;

    /// Pseudo-random points, uniformly distributed.
    fn points(count: u32) -> impl Iterator<Item = Point> {
        let bits = |index: u32, dimension: u32| (hash(hash(index).wrapping_add(dimension)) as u64) << 32;
        (0..count).map(move |index| [0, 1, 2, 3].map(|dimension| bits(index, dimension)))
    }

    fn coordinates(point: Point) -> [f64; DIMENSIONS] {
        point.map(|coordinate| coordinate as f64 / ALL)
    }

    /// Use of a path: above 0 only in a corner of three of the dimensions.
    fn use_of(point: Point) -> f64 {
        let [a, b, _, d] = coordinates(point);
        if a < 0.3 && b > 0.6 && d < 0.5 { 1.0 + a } else { 0.0 }
    }

    fn guide() -> Guide {
        let sample =
            |point| Sample { point, use_of_path: use_of(point), squares: use_of(point).powi(2), weight: 1.0 };
        Guide::new(&mut points(20_000).map(sample).collect::<Vec<_>>()).expect("some are of use")
    }

    #[test]
    fn weighted_means_over_warped_points_equal_means_over_uniform_points() {
        let guide = guide();
        let count = 100_000;
        let functions: [fn(Point) -> f64; 3] =
            [|_| 1.0, use_of, |point| coordinates(point).iter().product::<f64>()];
        for function in functions {
            let mean = |warp: &dyn Fn(Point) -> Warped| {
                let values = points(count).map(|point| {
                    let Warped { point, weight } = warp(point);
                    f64::from(weight) * function(point)
                });
                values.sum::<f64>() / f64::from(count)
            };
            let uniform = mean(&|point| Warped { point, weight: 1.0 });
            let guided = mean(&|point| guide.warp(point));
            assert!((guided / uniform - 1.0).abs() < 0.02, "{guided} instead of {uniform}");
        }
    }

    #[test]
    fn warped_points_are_more_useful_and_have_bounded_weights() {
        let guide = guide();
        let mean = |warped: &dyn Fn(Point) -> Point| {
            points(50_000).map(|point| use_of(warped(point))).sum::<f64>() / 50_000.0
        };
        let gain = mean(&|point| guide.warp(point).point) / mean(&|point| point);
        assert!(gain > 8.0, "{gain}");
        assert!((gain / guide.gain() - 1.0).abs() < 0.1, "{gain}, {} by its own account", guide.gain());
        for point in points(10_000) {
            assert!(f64::from(guide.warp(point).weight) <= 1.001 / UNIFORM_SHARE);
        }
    }

    #[test]
    fn samples_without_use_give_no_guide() {
        let sample = |point| Sample { point, use_of_path: 0.0, squares: 0.0, weight: 1.0 };
        assert!(Guide::new(&mut points(1000).map(sample).collect::<Vec<_>>()).is_none());
    }
}
