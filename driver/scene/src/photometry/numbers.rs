//! Numbers of a photometric file, with their lines.

/// Maximum number of angles of each kind.
pub(super) const MAX_ANGLES: usize = 10_000;

/// Fault in the text of a photometric file.
#[derive(Debug)]
pub(super) struct Fault {
    /// Line, from 1 on.
    pub(super) line: usize,
    pub(super) reason: String,
}

impl Fault {
    pub(super) fn at(line: usize, reason: impl Into<String>) -> Self {
        Self { line, reason: reason.into() }
    }
}

/// Numbers of a text, one after another, between blanks and commas.
pub(super) struct Numbers<'a> {
    words: Box<dyn Iterator<Item = (usize, &'a str)> + 'a>,
    /// Line of the last number.
    line: usize,
}

impl<'a> Numbers<'a> {
    /// Numbers of the lines that follow line `before`, counted from 1.
    pub(super) fn new(lines: impl Iterator<Item = &'a str> + 'a, before: usize) -> Self {
        let words = (before + 1..).zip(lines).flat_map(|(number, line)| {
            let words = line.split(|c: char| c.is_whitespace() || c == ',');
            words.filter(|word| !word.is_empty()).map(move |word| (number, word))
        });
        Self { words: Box::new(words), line: before }
    }

    /// Error at the last number that was read.
    pub(super) fn fault(&self, reason: impl Into<String>) -> Fault {
        Fault { line: self.line, reason: reason.into() }
    }

    /// Next number.
    pub(super) fn next(&mut self, name: &str) -> Result<f64, Fault> {
        let Some((line, word)) = self.words.next() else {
            return Err(self.fault(format!("the file ends before {name}")));
        };
        self.line = line;
        let number = word.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| self.fault(format!("{word:?} stands for {name}, and is no number")))
    }

    /// Next number, a count from 1 to `most`.
    pub(super) fn count(&mut self, name: &str, most: usize) -> Result<usize, Fault> {
        let number = self.next(name)?;
        if number.fract() == 0.0 && (1.0..=most as f64).contains(&number) {
            return Ok(number as usize);
        }
        Err(self.fault(format!("{name} is {number}, not 1 to {most}")))
    }

    /// Next `count` numbers.
    pub(super) fn take(&mut self, name: &str, count: usize) -> Result<Vec<f64>, Fault> {
        (1..=count).map(|index| self.next(&format!("{name} {index} of {count}"))).collect()
    }

    /// Checks that no number is left. Other words may follow, such as the end mark of an old system.
    pub(super) fn check_end(&mut self) -> Result<(), Fault> {
        match self.words.next().filter(|(_, word)| word.parse::<f64>().is_ok()) {
            Some((line, word)) => {
                Err(Fault::at(line, format!("{word:?} is one number more than the counts say")))
            }
            None => Ok(()),
        }
    }

    /// Next `count` intensities, which are 0 or more, each multiplied by `factor`.
    pub(super) fn intensities(&mut self, count: usize, factor: f64) -> Result<Vec<f64>, Fault> {
        let mut intensities = Vec::new();
        for index in 1..=count {
            let intensity = self.next(&format!("intensity {index} of {count}"))?;
            if intensity < 0.0 {
                return Err(self.fault(format!("intensity {index} of {count} is negative: {intensity}")));
            }
            let candelas = intensity * factor;
            if !candelas.is_finite() {
                return Err(self.fault(format!("intensity {index} of {count} is too large: {candelas}")));
            }
            intensities.push(candelas);
        }
        Ok(intensities)
    }
}
