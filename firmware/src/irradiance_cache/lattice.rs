//! The lattice of picture positions where irradiance records may be: squares of 16 pixels, halved up to three times.
//!
//! The lattice belongs to the picture and not to a tile: whoever needs the record at a position computes the same one.

/// Side of a coarsest cell, pixels.
pub(super) const COARSEST_SIDE: u32 = 16;
/// Levels: sides of 16, 8, 4 and 2 pixels.
pub(super) const LEVELS: u32 = 4;

/// Side of a cell of a level, pixels: never 0, so that it divides without a panic.
const fn side(level: u32) -> u32 {
    let side = COARSEST_SIDE >> level;
    if side == 0 { 1 } else { side }
}

/// A corner of pixels, counted from the picture's upper left corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct LatticePoint {
    /// To the right.
    pub x: u32,
    /// Downwards.
    pub y: u32,
}

/// How far from its lattice point a record is seen, pixels: in a symmetric view of a room, edges of walls run exactly
/// through lattice points, and a record in an edge sees nothing of what is right beside it.
const PLACE_OFFSET: [f32; 2] = [1.0 / 32.0, 1.0 / 64.0];

impl LatticePoint {
    /// The place of the picture where the point's record is seen.
    pub(super) fn place(&self) -> [f32; 2] {
        let [right, down] = PLACE_OFFSET;
        [self.x as f32 + right, self.y as f32 + down]
    }
}

/// A square of the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Cell {
    pub(super) corner: LatticePoint,
    /// 0 is the coarsest.
    pub(super) level: u32,
}

impl Cell {
    /// The coarsest cell that holds a pixel.
    pub(super) fn coarsest(x: u32, y: u32) -> Self {
        let floor = |v: u32| v - v % COARSEST_SIDE;
        Self { corner: LatticePoint { x: floor(x), y: floor(y) }, level: 0 }
    }

    /// Its side, pixels.
    pub(super) fn side(&self) -> u32 {
        side(self.level)
    }

    /// Whether it cannot be halved.
    pub(super) fn is_finest(&self) -> bool {
        self.level + 1 >= LEVELS
    }

    /// Its corners: the upper two, then the lower two, each from the left.
    pub(super) fn corners(&self) -> [LatticePoint; 4] {
        let LatticePoint { x, y } = self.corner;
        let side = self.side();
        [(0, 0), (side, 0), (0, side), (side, side)].map(|(dx, dy)| LatticePoint { x: x + dx, y: y + dy })
    }

    /// The points that its children add.
    pub(super) fn middles(&self) -> [LatticePoint; 5] {
        let LatticePoint { x, y } = self.corner;
        let [half, side] = [self.side() / 2, self.side()];
        [(half, half), (half, 0), (0, half), (side, half), (half, side)]
            .map(|(dx, dy)| LatticePoint { x: x + dx, y: y + dy })
    }

    /// Its number in the tree of its coarsest cell, the root 0; below 21 for a cell that can be halved.
    pub(super) fn tree_number(&self) -> u32 {
        let root = Self::coarsest(self.corner.x, self.corner.y);
        let first = ((1 << (2 * self.level)) - 1) / 3;
        let side = self.side();
        let [x, y] = [(self.corner.x - root.corner.x) / side, (self.corner.y - root.corner.y) / side];
        first + (y << self.level) + x
    }

    /// Cells of a level in the tree of one coarsest cell.
    pub(super) fn of_level(level: u32) -> usize {
        1 << (2 * level)
    }

    /// Cell `number` of a level, in rows, in the tree of the coarsest cell at `root`.
    pub(super) fn in_tree(root: LatticePoint, level: u32, number: usize) -> Self {
        let [row, column] = [number as u32 >> level, number as u32 & ((1 << level) - 1)];
        let side = side(level);
        Self { corner: LatticePoint { x: root.x + column * side, y: root.y + row * side }, level }
    }

    /// The cell that it is a quarter of; `None` of a coarsest one.
    pub(super) fn parent(&self) -> Option<Self> {
        let level = self.level.checked_sub(1)?;
        let floor = |v: u32| v - v % side(level);
        let LatticePoint { x, y } = self.corner;
        Some(Self { corner: LatticePoint { x: floor(x), y: floor(y) }, level })
    }

    /// The child that holds a pixel of this cell.
    pub(super) fn child_at(&self, x: u32, y: u32) -> Self {
        let half = (self.side() / 2).max(1);
        let step = |v: u32, from: u32| from + v.saturating_sub(from) / half * half;
        let corner = LatticePoint { x: step(x, self.corner.x), y: step(y, self.corner.y) };
        Self { corner, level: self.level + 1 }
    }

    /// Whether it has a pixel in common with a window.
    pub(super) fn overlaps(&self, window: &Window) -> bool {
        let LatticePoint { x, y } = self.corner;
        let side = self.side();
        x < window.x1 && x + side > window.x0 && y < window.y1 && y + side > window.y0
    }
}

/// A rectangle of the picture: columns `x0` up to `x1`, rows `y0` up to `y1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// First column.
    pub x0: u32,
    /// Past the last column.
    pub x1: u32,
    /// First row.
    pub y0: u32,
    /// Past the last row.
    pub y1: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_has_one_cell_of_each_level_and_cells_have_numbers_of_their_own() {
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
}
