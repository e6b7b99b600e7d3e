//! Samples that a partial render has kept. Each range of samples has a film.

use photoncard_picture::film::{Film, Window};
use photoncard_picture::sums::SumFormat;

/// Maximum number of ranges in a file. Each is a pass of the picture.
const MAX_RANGES: usize = 16;

/// Range of sample numbers of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SampleRange {
    pub(super) first: u32,
    pub(super) count: u32,
}

/// Films of the ranges of samples in a partial render's file, for a picture that may have more samples.
pub(super) struct KeptSamples<'a> {
    /// Empty film of the picture.
    empty: &'a Film,
    ranges: Vec<(SampleRange, Film)>,
    /// Greatest end of a range of samples in any record.
    most: u32,
}

/// Kept samples of a picture, divided into complete ones and others.
pub(super) struct Split {
    /// Complete film of the first samples; `None` if there are none, or if all samples of the picture are
    /// complete.
    pub(super) base: Option<Film>,
    /// Film of the remaining samples; `None` if none of their tiles is kept.
    pub(super) rest: Option<Film>,
}

impl<'a> KeptSamples<'a> {
    /// Creates a collection without samples, for the picture of the film `empty`.
    pub(super) fn new(empty: &'a Film) -> Self {
        Self { empty, ranges: Vec::new(), most: 0 }
    }

    pub(super) fn format(&self) -> &SumFormat {
        self.empty.format()
    }

    pub(super) fn window(&self) -> Window {
        self.empty.window()
    }

    /// Film of a range of samples; `None` if the picture does not have them, or there are too many ranges or
    /// too little memory for another film.
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

    /// Divides the kept samples into a complete film of the first ones and a film of the remaining ones.
    ///
    /// # Errors
    /// The greatest number of samples in the file, if the picture can take over none of the samples.
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
                // Adding cannot fail: all are films of one picture.
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
