//! Samples of a picture that the file of a partial render contains. Each range of sample numbers has a film.

use photoncard_picture::film::{Film, Window};
use photoncard_picture::sums::SumFormat;

/// Maximum number of sample ranges that are read from a file. Each range is a pass of the picture.
const MAX_RANGES: usize = 16;

/// Range of sample numbers, equal for all pixels of a film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SampleRange {
    pub(super) first: u32,
    pub(super) count: u32,
}

/// Films of the sample ranges in a partial render's file. The picture may have more samples than the file.
pub(super) struct KeptSamples<'a> {
    /// Empty film of the picture.
    empty: &'a Film,
    ranges: Vec<(SampleRange, Film)>,
    /// Greatest end of the sample ranges in all records of the file.
    most: u32,
}

/// Samples taken over from a file: first samples, which all pixels have, and the remaining samples.
pub(super) struct Split {
    /// Film of the first samples, which has all pixels. `None` if there are no such samples, or if they are
    /// all samples of the picture.
    pub(super) base: Option<Film>,
    /// Film of the remaining samples, which may lack pixels; `None` if the file has no tiles of these
    /// samples.
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

    /// Film of a range of samples, created if it does not exist. `None` if the picture does not have these
    /// samples, there are too many ranges, or memory is too small for another film.
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

    /// Joins the complete ranges from sample 0 on to one film, and finds the film of all remaining samples.
    ///
    /// # Errors
    /// The greatest end of a sample range in the file, if the picture can take over none of the samples.
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
