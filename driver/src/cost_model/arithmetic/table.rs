//! Operations of a step. Written by `tests/operations.sh`.

use super::operations::Operations;
use super::step::Step;
use crate::choice::Choice;

/// Operations of one step of each kind, in the order of [`Step::ALL`]: means over tiles of several scenes.
#[rustfmt::skip] // One step a line.
pub const OPERATIONS: [Operations; Step::ALL.len()] = [
    // Preparation of a ray
    Operations { add: 0.0, multiply: 0.0, divide: 6.0, square_root: 0.0, compare: 6.0, convert: 0.0 },
    // A node of the hierarchy
    Operations { add: 9.0, multiply: 9.0, divide: 0.0, square_root: 0.0, compare: 3.0, convert: 0.0 },
    // A box of a node
    Operations { add: 6.0, multiply: 6.0, divide: 0.0, square_root: 0.0, compare: 7.0, convert: 6.0 },
    // A vertex of a leaf
    Operations { add: 5.0, multiply: 2.0, divide: 0.0, square_root: 0.0, compare: 0.0, convert: 0.0 },
    // A triangle of a leaf
    Operations { add: 3.0, multiply: 8.0, divide: 0.0, square_root: 0.0, compare: 7.0, convert: 0.0 },
    // Triangles of a leaf that may be met
    Operations { add: 20.00, multiply: 16.72, divide: 0.9091, square_root: 0.0, compare: 8.738, convert: 0.0 },
    // A box of photons
    Operations { add: 8.0, multiply: 9.0, divide: 0.0, square_root: 0.0, compare: 7.0, convert: 6.0 },
    // A photon of a leaf
    Operations { add: 5.0, multiply: 6.0, divide: 0.0, square_root: 0.0, compare: 0.0, convert: 3.0 },
    // A photon of the kd-tree
    Operations { add: 5.0, multiply: 4.0, divide: 0.0, square_root: 0.0, compare: 3.425, convert: 0.0 },
    // A candidate that a selection reads
    Operations { add: 0.01598, multiply: 0.02168, divide: 0.02130, square_root: 0.0, compare: 0.01296, convert: 0.01387 },
    // A comparison of two distances
    Operations { add: 0.0, multiply: 0.0, divide: 0.0, square_root: 0.0, compare: 1.0, convert: 0.0 },
    // A gather at the end of a ray
    Operations { add: 40.00, multiply: 78.33, divide: 8.781, square_root: 0.7699, compare: 8.347, convert: 40.81 },
    // The normal of a photon
    Operations { add: 8.039, multiply: 9.043, divide: 3.014, square_root: 1.005, compare: 2.010, convert: 2.010 },
    // A photon that a lobe reflects
    Operations { add: 6.614, multiply: 12.05, divide: 2.130, square_root: 0.7101, compare: 0.7106, convert: 5.681 },
    // The value of a Phong lobe for a photon
    Operations { add: 43.41, multiply: 29.58, divide: 1.636, square_root: 0.0, compare: 0.9007, convert: 0.8236 },
    // The value of a microfacet lobe for a photon
    Operations { add: 7.804, multiply: 13.05, divide: 1.919, square_root: 1.450, compare: 2.473, convert: 0.0 },
    // A surface that is read
    Operations { add: 38.13, multiply: 51.22, divide: 1.813, square_root: 1.379, compare: 19.78, convert: 3.632 },
    // A record of a light
    Operations { add: 35.73, multiply: 47.49, divide: 6.707, square_root: 8.500, compare: 24.08, convert: 4.032 },
    // A shadow ray
    Operations { add: 67.66, multiply: 77.30, divide: 17.41, square_root: 4.905, compare: 27.21, convert: 12.40 },
    // A gather ray
    Operations { add: 39.14, multiply: 84.55, divide: 8.177, square_root: 2.266, compare: 20.65, convert: 12.17 },
    // A table of directions
    Operations { add: 413.7, multiply: 393.5, divide: 9.645, square_root: 3.627, compare: 270.7, convert: 219.4 },
    // A photon of a table of directions
    Operations { add: 6.009, multiply: 8.794, divide: 1.283, square_root: 0.4242, compare: 2.580, convert: 2.292 },
    // A survey ray
    Operations { add: 23.11, multiply: 39.25, divide: 2.062, square_root: 2.062, compare: 3.387, convert: 8.142 },
    // A gather ray of an irradiance record
    Operations { add: 28.73, multiply: 85.74, divide: 3.116, square_root: 2.476, compare: 0.5600, convert: 36.66 },
    // A sample that is interpolated
    Operations { add: 316.4, multiply: 296.2, divide: 15.50, square_root: 23.46, compare: 57.62, convert: 6.542 },
    // An eye ray
    Operations { add: 53.21, multiply: 46.64, divide: 18.44, square_root: 5.240, compare: 13.36, convert: 40.58 },
];
