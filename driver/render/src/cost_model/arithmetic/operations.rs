//! Numbers of floating-point operations, by kind.

use serde::{Deserialize, Serialize};

/// Numbers of operations by kind. A vector operation counts once per lane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Operations {
    /// Additions and subtractions.
    pub add: f64,
    /// Multiplications.
    pub multiply: f64,
    /// Divisions.
    pub divide: f64,
    /// Square roots.
    pub square_root: f64,
    /// Comparisons, minima and maxima, including comparisons of squared distances by their bits.
    pub compare: f64,
    /// Conversions between integers and floating point, and roundings to integers. [`Self::flops`] excludes
    /// them.
    pub convert: f64,
}

impl Operations {
    /// Floating-point operations of all kinds, without conversions.
    pub fn flops(&self) -> f64 {
        self.add + self.multiply + self.divide + self.square_root + self.compare
    }

    /// Numbers by kind, in the order of the fields.
    pub fn to_array(self) -> [f64; 6] {
        [self.add, self.multiply, self.divide, self.square_root, self.compare, self.convert]
    }

    /// Operations of `count` repetitions.
    #[must_use]
    pub fn times(&self, count: f64) -> Self {
        Self {
            add: self.add * count,
            multiply: self.multiply * count,
            divide: self.divide * count,
            square_root: self.square_root * count,
            compare: self.compare * count,
            convert: self.convert * count,
        }
    }

    /// Adds the operations of `other`.
    pub fn add(&mut self, other: &Self) {
        self.add += other.add;
        self.multiply += other.multiply;
        self.divide += other.divide;
        self.square_root += other.square_root;
        self.compare += other.compare;
        self.convert += other.convert;
    }
}
