//! Operations per step. Written by `tests/operations.sh`.

use photoncard_picture::choice::Choice;

use super::step::{Operations, Step};

/// Operations per step, in the order of [`Step::ALL`]: means over tiles of several scenes.
#[rustfmt::skip] // One step a line.
pub const OPERATIONS: [Operations; Step::ALL.len()] = [
    // Preparation of a ray
    Operations { add: 0.0, multiply: 0.0, divide: 6.0, square_root: 0.0, compare: 9.0, convert: 0.0 },
    // A node of the hierarchy
    Operations { add: 8.330, multiply: 8.330, divide: 0.0, square_root: 0.0, compare: 0.0, convert: 0.0 },
    // A box of a node
    Operations { add: 6.0, multiply: 6.0, divide: 0.0, square_root: 0.0, compare: 7.0, convert: 6.0 },
    // A vertex of a leaf
    Operations { add: 5.0, multiply: 2.0, divide: 0.0, square_root: 0.0, compare: 0.0, convert: 0.0 },
    // A triangle of a leaf
    Operations { add: 3.0, multiply: 8.0, divide: 0.0, square_root: 0.0, compare: 7.0, convert: 0.0 },
    // Triangles of a leaf that may be met
    Operations { add: 3.506, multiply: 5.504, divide: 0.8765, square_root: 0.0, compare: 8.451, convert: 0.0 },
    // A box of photons
    Operations { add: 8.0, multiply: 9.0, divide: 0.0, square_root: 0.0, compare: 7.0, convert: 6.0 },
    // A photon of a leaf
    Operations { add: 5.0, multiply: 6.0, divide: 0.0, square_root: 0.0, compare: 0.0, convert: 3.0 },
    // A photon of the kd-tree
    Operations { add: 5.0, multiply: 4.0, divide: 0.0, square_root: 0.0, compare: 3.425, convert: 0.0 },
    // A candidate that a selection reads
    Operations { add: 0.01616, multiply: 0.02243, divide: 0.02199, square_root: 0.0, compare: 0.01388, convert: 0.01457 },
    // A comparison of two distances
    Operations { add: 0.0, multiply: 0.0, divide: 0.0, square_root: 0.0, compare: 1.0, convert: 0.0 },
    // A gather at the end of a ray
    Operations { add: 44.01, multiply: 78.15, divide: 9.842, square_root: 0.8030, compare: 8.495, convert: 36.93 },
    // The normal of a photon
    Operations { add: 8.053, multiply: 9.059, divide: 3.020, square_root: 1.007, compare: 2.013, convert: 2.013 },
    // A photon that a lobe reflects
    Operations { add: 7.497, multiply: 13.71, divide: 2.467, square_root: 0.8216, compare: 0.8241, convert: 6.579 },
    // The value of a Phong lobe for a photon
    Operations { add: 42.87, multiply: 29.23, divide: 1.614, square_root: 0.0, compare: 0.9062, convert: 0.8138 },
    // The value of a microfacet lobe for a photon
    Operations { add: 11.59, multiply: 19.43, divide: 2.863, square_root: 2.158, compare: 3.658, convert: 0.0 },
    // A surface that is read
    Operations { add: 34.29, multiply: 45.96, divide: 1.519, square_root: 1.326, compare: 18.74, convert: 2.601 },
    // A record of a light
    Operations { add: 23.66, multiply: 29.34, divide: 4.609, square_root: 4.825, compare: 15.65, convert: 3.046 },
    // A shadow ray
    Operations { add: 73.35, multiply: 88.83, divide: 15.18, square_root: 4.248, compare: 27.83, convert: 5.931 },
    // A gather ray
    Operations { add: 51.54, multiply: 103.2, divide: 9.031, square_root: 2.918, compare: 23.47, convert: 14.48 },
    // A table of directions
    Operations { add: 495.2, multiply: 538.0, divide: 22.07, square_root: 22.79, compare: 167.3, convert: 90.68 },
    // A photon of a table of directions
    Operations { add: 5.335, multiply: 7.714, divide: 1.186, square_root: 0.3921, compare: 2.237, convert: 1.996 },
    // A survey ray
    Operations { add: 23.21, multiply: 39.39, divide: 2.144, square_root: 2.082, compare: 3.645, convert: 6.343 },
    // A gather ray of an irradiance record
    Operations { add: 29.37, multiply: 87.77, divide: 3.265, square_root: 2.518, compare: 0.5600, convert: 37.54 },
    // A sample that is interpolated
    Operations { add: 424.0, multiply: 375.4, divide: 18.60, square_root: 36.06, compare: 86.07, convert: 6.825 },
    // An eye ray
    Operations { add: 103.7, multiply: 155.1, divide: 20.81, square_root: 6.264, compare: 21.36, convert: 100.9 },
];
