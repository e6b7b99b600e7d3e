//! Left-balanced kd-tree (Jensen 2001, chapter 6): a complete binary tree, stored without gaps in heap order.

use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{Photon, PhotonLeaf, Record};

use super::store::PHOTON_SECTIONS;
use crate::pack::{CardImage, ImageWriter, PackError};
use crate::photon::StoredPhoton;

/// Number of photons below which a subtree is built by one thread.
const SEQUENTIAL: usize = 4096;

/// Moves the photons of a card image from leaves into a kd-tree, and removes irradiance points and caustic
/// photons. Searches find the same photons in both layouts.
///
/// # Errors
/// [`PackError::TooLarge`] if there are more lines than an address can number.
pub fn to_kd_tree(image: CardImage) -> Result<CardImage, PackError> {
    let mut photons = photons_of_leaves(&image);
    if photons.is_empty() {
        return Ok(image);
    }
    balance(&mut photons);
    let (scene, _) = image.view();
    let mut image = ImageWriter::resume(image);
    image.remove_last(&PHOTON_SECTIONS);
    let lines = image.append_zeroed(SectionKind::Photons, photons.len())?;
    for_each_in_heap(&photons, &mut |place, photon| {
        let line = &mut lines[place / Photon::PER_LINE];
        if let Some(record) = line.record_mut(place % Photon::PER_LINE) {
            *record = photon.record(&scene.header.photon_grid);
        }
    });
    Ok(image.finish())
}

fn photons_of_leaves(image: &CardImage) -> Vec<StoredPhoton> {
    let leaves = || image.section(SectionKind::PhotonLeaves).iter().map(|line| PhotonLeaf::read(&line.0));
    let mut photons = Vec::with_capacity(leaves().map(|leaf| leaf.photons() as usize).sum());
    for leaf in leaves() {
        photons.extend((0..leaf.photons()).map(|i| StoredPhoton::at(leaf.point(i), leaf.content(i))));
    }
    photons
}

/// Number of nodes in the left subtree of a left-balanced tree with `count` nodes. `count` must be at least
/// 1.
fn left_nodes(count: usize) -> usize {
    let last_level = 1 << count.ilog2();
    let in_last_level = count - (last_level - 1);
    (last_level / 2).saturating_sub(1) + in_last_level.min(last_level / 2)
}

/// Sorts photons into in-order: in every subtree the left subtree comes first, then the root, then the right
/// subtree. Each subtree is split along the longest side of its bounding box. The tree depends neither on the
/// photons' initial order nor on threads.
fn balance(photons: &mut [StoredPhoton]) {
    if photons.len() < 2 {
        return;
    }
    let axis = longest_side(photons);
    let middle = left_nodes(photons.len());
    let (left, root, right) =
        photons.select_nth_unstable_by_key(middle, |photon| (photon.coordinate(axis), *photon));
    *root = root.split_on(axis);
    if left.len() > SEQUENTIAL {
        rayon::join(|| balance(left), || balance(right));
    } else {
        balance(left);
        balance(right);
    }
}

fn longest_side(photons: &[StoredPhoton]) -> usize {
    let side = |axis: &usize| {
        let coordinates = || photons.iter().map(|photon| photon.coordinate(*axis));
        coordinates().max().unwrap_or(0) - coordinates().min().unwrap_or(0)
    };
    (0..3).max_by_key(side).unwrap_or(0)
}

/// Calls `put` for every node of a balanced tree, with its heap index; the children of `i` are `2 i + 1` and
/// `2 i + 2`.
fn for_each_in_heap(photons: &[StoredPhoton], put: &mut impl FnMut(usize, StoredPhoton)) {
    // Subtrees to visit: the heap index of each root, and the photons in-order.
    let mut waiting = vec![(0, photons)];
    while let Some((node, run)) = waiting.pop() {
        if run.is_empty() {
            continue;
        }
        let (left, rest) = run.split_at(left_nodes(run.len()));
        if let [root, right @ ..] = rest {
            put(node, *root);
            waiting.extend([(2 * node + 2, right), (2 * node + 1, left)]);
        }
    }
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::sampler::hash;

    use super::*;

    fn photons(count: u32) -> Vec<StoredPhoton> {
        let coordinate =
            |i: u32, axis: u32| hash(hash(i).wrapping_add(axis)) >> if axis == 2 { 16 } else { 12 };
        (0..count).map(|i| StoredPhoton::at([0, 1, 2].map(|axis| coordinate(i, axis)), [0; 8])).collect()
    }

    /// Photons of a tree, in heap order.
    fn heap(count: u32) -> Vec<StoredPhoton> {
        let mut sorted = photons(count);
        balance(&mut sorted);
        let mut heap = vec![None; sorted.len()];
        for_each_in_heap(&sorted, &mut |node, photon| assert_eq!(heap[node].replace(photon), None));
        heap.into_iter().map(|photon| photon.expect("no gap")).collect()
    }

    fn check(heap: &[StoredPhoton], node: usize, lower: [u32; 3], upper: [u32; 3]) -> usize {
        let Some(photon) = heap.get(node) else { return 0 };
        for axis in 0..3 {
            assert!((lower[axis]..=upper[axis]).contains(&photon.coordinate(axis)));
        }
        let axis = usize::from(photon.content()[6] & 3);
        let (mut below, mut above) = (upper, lower);
        below[axis] = photon.coordinate(axis);
        above[axis] = photon.coordinate(axis);
        1 + check(heap, 2 * node + 1, lower, below) + check(heap, 2 * node + 2, above, upper)
    }

    #[test]
    fn every_subtree_lies_on_its_side_of_every_plane() {
        for count in [1, 2, 3, 6, 7, 8, 100, 1000, 20_000] {
            assert_eq!(check(&heap(count), 0, [0; 3], [u32::MAX; 3]), count as usize);
        }
    }

    #[test]
    fn left_subtrees_fill_the_last_level_from_the_left() {
        let expected = [0, 1, 1, 2, 3, 3, 3, 4, 5, 6, 7, 7];
        for (count, left) in (1..).zip(expected) {
            assert_eq!(left_nodes(count), left, "{count}");
        }
    }
}
