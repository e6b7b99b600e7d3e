//! Lattice of irradiance records: cells of 16x16 pixels, each of which is the root of a quadtree with four
//! levels.
//!
//! The lattice belongs to the picture, not to a tile, so that all tiles compute the same record for a lattice
//! point.

/// Side of the coarsest cells, pixels.
pub(super) const COARSEST_SIDE: u32 = 16;
/// Number of levels of cells, whose sides are 16, 8, 4 and 2 pixels.
pub(super) const LEVELS: u32 = 4;

/// Side of the cells at a level, pixels. It is at least 1, so that division by it cannot panic.
const fn side(level: u32) -> u32 {
    let side = COARSEST_SIDE >> level;
    if side == 0 { 1 } else { side }
}

/// Corner of a lattice cell, pixels from the picture's upper left corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LatticePoint {
    /// Distance from the picture's left edge, pixels.
    pub x: u32,
    /// Distance from the picture's upper edge, pixels.
    pub y: u32,
}

/// Offset of a record's eye ray from its lattice point, pixels. In a symmetric view of a room, edges between
/// walls would otherwise run exactly through lattice points. The survey rays of a record on an edge would
/// miss the adjacent wall.
const FILM_OFFSET: [f32; 2] = [1.0 / 32.0, 1.0 / 64.0];

/// Position of the light group in the row of a key. Rows are below 2^17: a picture has at most 2^16, and a
/// lattice point lies at most a cell beyond.
const GROUP_SHIFT: u32 = 30;

impl LatticePoint {
    /// Key of the records of a light group at this point.
    pub(super) fn of_group(self, group: usize) -> Self {
        Self { y: self.y | (group as u32) << GROUP_SHIFT, ..self }
    }

    /// Position in the picture, pixels, through which the eye ray of this point's record goes.
    pub(super) fn film_position(&self) -> [f32; 2] {
        let [right, down] = FILM_OFFSET;
        [self.x as f32 + right, self.y as f32 + down]
    }
}

/// A square cell of the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Cell {
    pub(super) corner: LatticePoint,
    /// Level in the quadtree; 0 is the coarsest.
    pub(super) level: u32,
}

impl Cell {
    /// The coarsest cell that contains a pixel.
    pub(super) fn coarsest(x: u32, y: u32) -> Self {
        let floor = |v: u32| v - v % COARSEST_SIDE;
        Self { corner: LatticePoint { x: floor(x), y: floor(y) }, level: 0 }
    }

    /// Side of the cell, pixels.
    pub(super) fn side(&self) -> u32 {
        side(self.level)
    }

    /// Returns whether the cell is at the last level and cannot be divided.
    pub(super) fn is_finest(&self) -> bool {
        self.level + 1 >= LEVELS
    }

    /// Corners of the cell: upper left, upper right, lower left, lower right.
    pub(super) fn corners(&self) -> [LatticePoint; 4] {
        let LatticePoint { x, y } = self.corner;
        let side = self.side();
        let point = |dx, dy| LatticePoint { x: x + dx, y: y + dy };
        [point(0, 0), point(side, 0), point(0, side), point(side, side)]
    }

    /// Corners of the cell's children that are not corners of the cell: its centre and the midpoints of its
    /// sides.
    pub(super) fn middles(&self) -> [LatticePoint; 5] {
        let LatticePoint { x, y } = self.corner;
        let [half, side] = [self.side() / 2, self.side()];
        [(half, half), (half, 0), (0, half), (side, half), (half, side)]
            .map(|(dx, dy)| LatticePoint { x: x + dx, y: y + dy })
    }

    /// Index of the cell in its quadtree, level by level from the root, which is 0. It is below 21 for cells
    /// that can be divided.
    pub(super) fn tree_number(&self) -> u32 {
        let root = Self::coarsest(self.corner.x, self.corner.y);
        let first = ((1 << (2 * self.level)) - 1) / 3;
        let side = self.side();
        let [x, y] = [(self.corner.x - root.corner.x) / side, (self.corner.y - root.corner.y) / side];
        first + (y << self.level) + x
    }

    /// Number of cells at a level of one quadtree.
    pub(super) fn of_level(level: u32) -> usize {
        1 << (2 * level)
    }

    /// Cell with row-major index `number` at `level` of the quadtree whose upper left corner is `root`.
    pub(super) fn in_tree(root: LatticePoint, level: u32, number: usize) -> Self {
        let [row, column] = [number as u32 >> level, number as u32 & ((1 << level) - 1)];
        let side = side(level);
        Self { corner: LatticePoint { x: root.x + column * side, y: root.y + row * side }, level }
    }

    /// Cell that this cell is a quarter of; `None` for a coarsest cell.
    pub(super) fn parent(&self) -> Option<Self> {
        let level = self.level.checked_sub(1)?;
        let floor = |v: u32| v - v % side(level);
        let LatticePoint { x, y } = self.corner;
        Some(Self { corner: LatticePoint { x: floor(x), y: floor(y) }, level })
    }

    /// The child that contains a pixel of this cell.
    pub(super) fn child_at(&self, x: u32, y: u32) -> Self {
        let half = (self.side() / 2).max(1);
        let step = |v: u32, from: u32| from + v.saturating_sub(from) / half * half;
        let corner = LatticePoint { x: step(x, self.corner.x), y: step(y, self.corner.y) };
        Self { corner, level: self.level + 1 }
    }

    /// Returns whether the cell and a window have a pixel in common.
    pub(super) fn overlaps(&self, window: &Window) -> bool {
        let LatticePoint { x, y } = self.corner;
        let side = self.side();
        x < window.x1 && x + side > window.x0 && y < window.y1 && y + side > window.y0
    }
}

/// A rectangle of the picture with columns `x0..x1` and rows `y0..y1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// First column.
    pub x0: u32,
    /// Column past the last.
    pub x1: u32,
    /// First row.
    pub y0: u32,
    /// Row past the last.
    pub y1: u32,
}

impl Window {
    /// Number of pixels.
    pub(crate) fn pixels(&self) -> u64 {
        u64::from(self.x1.saturating_sub(self.x0)) * u64::from(self.y1.saturating_sub(self.y0))
    }

    /// Upper bound of the number of lattice points of the window: all corners of the finest cells in the
    /// coarsest cells that overlap the window.
    pub(crate) fn most_points(&self) -> u64 {
        let of_axis = |first: u32, end: u32| {
            let cells = u64::from(end).div_ceil(COARSEST_SIDE.into()) - u64::from(first / COARSEST_SIDE);
            cells * u64::from(COARSEST_SIDE / side(LEVELS - 1)) + 1
        };
        of_axis(self.x0, self.x1.max(self.x0)) * of_axis(self.y0, self.y1.max(self.y0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_has_one_cell_per_level_and_cells_have_unique_numbers() {
        let mut numbers = std::collections::BTreeSet::new();
        for (x, y) in (32..48).flat_map(|x| (16..32).map(move |y| (x, y))) {
            let mut cell = Cell::coarsest(x, y);
            assert_eq!((cell.corner, cell.tree_number()), (LatticePoint { x: 32, y: 16 }, 0));
            while !cell.is_finest() {
                numbers.insert((cell.tree_number(), cell.level, cell.corner.x, cell.corner.y));
                let child = cell.child_at(x, y);
                assert_eq!(child.parent(), Some(cell));
                assert!(child.overlaps(&Window { x0: x, x1: x + 1, y0: y, y1: y + 1 }));
                cell = child;
            }
            assert_eq!(cell.side(), 2);
        }
        assert_eq!(numbers.len(), 21);
        assert!(numbers.iter().map(|cell| cell.0).eq(0..21));
    }

    #[test]
    fn the_cells_of_a_level_cover_their_coarsest_cell_once() {
        let root = LatticePoint { x: 48, y: 16 };
        for level in 0..LEVELS {
            let cells = (0..Cell::of_level(level)).map(|number| Cell::in_tree(root, level, number));
            let corners: std::collections::BTreeSet<_> =
                cells.clone().map(|cell| (cell.corner.x, cell.corner.y)).collect();
            assert_eq!(corners.len(), Cell::of_level(level));
            for cell in cells {
                assert_eq!(Cell::coarsest(cell.corner.x, cell.corner.y).corner, root);
                assert_eq!(cell.corner.x % cell.side(), 0);
            }
        }
    }

    #[test]
    fn a_division_adds_the_middles_to_the_corners() {
        let cell = Cell::coarsest(20, 20);
        let children = (0..4).map(|number| Cell::in_tree(cell.corner, 1, number));
        for corner in children.flat_map(|child| child.corners()) {
            assert!(cell.middles().contains(&corner) || cell.corners().contains(&corner));
        }
    }

    #[test]
    fn a_window_has_no_more_points_than_its_bound() {
        for (x0, width, y0, height) in
            [(0, 16, 0, 16), (5, 1, 31, 2), (16, 17, 32, 3), (15, 2, 7, 33), (0, 64, 0, 1)]
        {
            let window = Window { x0, x1: x0 + width, y0, y1: y0 + height };
            let mut points = std::collections::BTreeSet::new();
            for (x, y) in (x0..window.x1).flat_map(|x| (y0..window.y1).map(move |y| (x, y))) {
                let root = Cell::coarsest(x, y).corner;
                for number in 0..Cell::of_level(LEVELS - 1) {
                    let corners = Cell::in_tree(root, LEVELS - 1, number).corners();
                    points.extend(corners.map(|LatticePoint { x, y }| (x, y)));
                }
            }
            assert_eq!(points.len() as u64, window.most_points(), "{window:?}");
            assert_eq!(window.pixels(), u64::from(width * height));
        }
        assert_eq!(Window { x0: 3, x1: 3, y0: 4, y1: 4 }.pixels(), 0);
    }
}
