//! Samples that a partial render has kept: a film for each range of them.

use photoncard_picture::film::{Film, Window};
use photoncard_picture::sums::SumFormat;

/// Maximum number of ranges of a file: passes of one picture.
const MAX_RANGES: usize = 16;

/// Range of a pixel's samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SampleRange {
    pub(super) first: u32,
    pub(super) count: u32,
}

/// Films of ranges of samples, for a picture of more of them.
pub(super) struct KeptSamples<'a> {
    /// Empty film of the picture.
    empty: &'a Film,
    ranges: Vec<(SampleRange, Film)>,
    /// Maximum number of samples, up to the last, that any record has.
    most: u32,
}

/// Samples of a picture, as far as they are kept.
pub(super) struct Split {
    /// The complete film of the first samples, if there are any but not all of the picture's.
    pub(super) base: Option<Film>,
    /// Film of the other samples; `None` if none of their tiles is kept.
    pub(super) rest: Option<Film>,
}

impl<'a> KeptSamples<'a> {
    /// No samples yet of the picture that `empty` is the film of.
    pub(super) fn new(empty: &'a Film) -> Self {
        Self { empty, ranges: Vec::new(), most: 0 }
    }

    pub(super) fn format(&self) -> &SumFormat {
        self.empty.format()
    }

    pub(super) fn window(&self) -> Window {
        self.empty.window()
    }

    /// Film of a range of samples; `None` if the picture does not have them, or there is no room for a film
    /// of them.
    pub(super) fn film_of(&mut self, samples: SampleRange) -> Option<&mut Film> {
        let end = samples.first.saturating_add(samples.count);
        self.most = self.most.max(end);
        if end > self.format().samples {
            return None;
        }
        let found = self.ranges.iter().position(|(range, _)| *range == samples);
        let index = match found {
            Some(index) => index,
            None if self.ranges.len() < MAX_RANGES => {
                self.ranges.push((samples, self.empty.empty_with(samples.first, samples.count).ok()?));
                self.ranges.len() - 1
            }
            None => return None,
        };
        self.ranges.get_mut(index).map(|(_, film)| film)
    }

    /// The samples that the picture takes over.
    ///
    /// # Errors
    /// If there are samples of pictures of other numbers alone: the greatest of these numbers.
    pub(super) fn split(mut self) -> Result<Split, u32> {
        let samples = self.format().samples;
        let mut base: Option<Film> = None;
        let done = |base: &Option<Film>| base.as_ref().map_or(0, |film| film.format().samples);
        loop {
            let first = done(&base);
            let is_next = |(range, film): &(SampleRange, Film)| {
                range.first == first && first + range.count < samples && film.is_complete()
            };
            let longest = (0..self.ranges.len())
                .filter(|&index| is_next(&self.ranges[index]))
                .max_by_key(|&index| self.ranges[index].0.count);
            let Some(index) = longest else { break };
            let (_, film) = self.ranges.swap_remove(index);
            match &mut base {
                None => base = Some(film),
                // Cannot fail: all are films of one picture.
                Some(base) => drop(base.add(&film)),
            }
        }
        let first = done(&base);
        let rest = SampleRange { first, count: samples - first };
        let kept = self.ranges.iter().position(|(range, _)| *range == rest);
        let rest = kept.map(|index| self.ranges.swap_remove(index).1);
        if base.is_none() && rest.is_none() && self.most > 0 {
            return Err(self.most);
        }
        Ok(Split { base, rest })
    }
}
