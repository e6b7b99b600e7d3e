//! Atlas: places of charts on square pages, at a density of texels.

use std::collections::BTreeMap;

use glam::DVec2;
use guillotiere::{AtlasAllocator, size2};

use super::charts::{Chart, charts};
use super::error::BakeError;
use super::overlap::bounds;
use super::raster::{Rectangle, touched};
use super::stated::stated;
use super::surfaces::Surfaces;

/// Texels around each chart: two charts are apart by twice as many.
pub const PADDING: u32 = 1;
/// Maximum number of pages.
pub const MAX_PAGES: u64 = 256;
/// Sides of pages that are possible, texels.
const SIZES: std::ops::RangeInclusive<u32> = 64..=8192;
/// Side, texels, of the one page that the scene fits at the default density.
const DEFAULT_SIDE: u32 = 1024;
/// Distance of the parts of a stated layout, texels, from which it is taken.
const GUTTER: i64 = 2;
/// Factor between the densities that are tried for the default.
const STEP: f64 = 0.95;
/// Excess of a chart over a number of texels that takes no further texel.
const SLACK: f64 = 1e-6;

/// A chart on a page.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedChart {
    /// Primitive of each triangle, an index into [`Surfaces::primitives`].
    pub primitives: Vec<u32>,
    /// Indices of the triangles in the scene without instances.
    pub triangles: Vec<u32>,
    /// Places of each triangle's corners on the page, texels.
    pub places: Vec<[DVec2; 3]>,
    /// Number of the page.
    pub page: u32,
    /// Texels that the chart may touch.
    pub rectangle: Rectangle,
}

/// Charts of all baked surfaces on pages.
#[derive(Clone, Debug, PartialEq)]
pub struct Atlas {
    /// Side of each page, texels.
    pub size: u32,
    /// Number of pages.
    pub pages: u32,
    /// Texels per metre.
    pub density: f64,
    /// Charts in the order of objects.
    pub charts: Vec<PlacedChart>,
    /// Number of objects that keep the layout of their file.
    pub stated: usize,
}

/// Charts of one object, before they are placed.
struct Object {
    object: u32,
    /// Charts of the layout that the file states.
    stated: Option<Vec<Chart>>,
    charts: Vec<Chart>,
    /// Primitive of each triangle.
    primitive_of: BTreeMap<u32, u32>,
}

/// Page of a block, and its first texel without padding.
type Origin = (u32, [u32; 2]);

/// Charts that keep their places among each other, in a rectangle.
struct Block<'c> {
    object: &'c Object,
    charts: &'c [Chart],
    /// Sides with padding, texels.
    sides: [u64; 2],
}

impl Atlas {
    /// Places the charts of surfaces on pages of at most `size * size` texels. Without a `density`, it is the
    /// greatest tried at which one page of 1024 x 1024 texels holds all.
    ///
    /// # Errors
    /// If density or size are not possible, or the texels do not fit the pages.
    pub fn new(surfaces: &Surfaces, density: Option<f64>, size: u32) -> Result<Self, BakeError> {
        if !SIZES.contains(&size) {
            return Err(BakeError::Size { size });
        }
        if let Some(density) = density.filter(|density| !(density.is_finite() && *density > 0.0)) {
            return Err(BakeError::Density { density });
        }
        let objects = objects(surfaces);
        if let Some(density) = density {
            // One page is as small as it can be.
            let sides = std::iter::successors(Some(*SIZES.start()), |side| Some(side * 2));
            let mut smaller = sides.take_while(|side| *side < size);
            let on_one = smaller.find_map(|side| placed(surfaces, &objects, density, [side, size], 1).ok());
            return on_one.map_or_else(|| placed(surfaces, &objects, density, [size; 2], MAX_PAGES), Ok);
        }
        let size = size.min(DEFAULT_SIDE);
        let area = |chart: &Chart| chart.extent.x * chart.extent.y;
        let of_charts: f64 = objects.iter().flat_map(|object| &object.charts).map(area).sum();
        let mut density = rounded(f64::from(size) / of_charts.max(1e-12).sqrt());
        loop {
            match placed(surfaces, &objects, density, [size; 2], 1) {
                Err(error) if density < f64::MIN_POSITIVE / STEP || is_crowded(&objects, size) => {
                    return Err(error);
                }
                Err(_) => density = rounded(density * STEP),
                placed => return placed,
            }
        }
    }
}

/// Density with three decimal digits, as it is printed.
fn rounded(density: f64) -> f64 {
    format!("{density:.2e}").parse().unwrap_or(density)
}

/// Returns whether a page is too small for charts of one texel.
fn is_crowded(objects: &[Object], size: u32) -> bool {
    let charts: usize = objects.iter().map(|object| object.charts.len()).sum();
    charts as u64 * u64::from(1 + 2 * PADDING).pow(2) > u64::from(size).pow(2)
}

fn objects(surfaces: &Surfaces) -> Vec<Object> {
    let baked: Vec<_> = surfaces.baked().collect();
    let of_chunk = |chunk: &[(u32, &super::surfaces::Primitive)]| {
        let object = chunk.first().map_or(0, |(_, primitive)| primitive.object);
        let all: Vec<u32> = chunk.iter().flat_map(|(_, primitive)| primitive.triangles.clone()).collect();
        let primitive_of = chunk
            .iter()
            .flat_map(|(index, primitive)| {
                primitive.triangles.iter().map(move |triangle| (*triangle, *index))
            })
            .collect();
        let charts = chunk.iter().flat_map(|(_, primitive)| charts(surfaces, &primitive.triangles)).collect();
        Object { object, stated: stated(surfaces, &all), charts, primitive_of }
    };
    baked.chunk_by(|one, other| one.1.object == other.1.object).map(of_chunk).collect()
}

/// Places all charts at a density on at most `most` pages of a size. Layouts of the file are kept that fit
/// pages of the size `largest`.
fn placed(
    surfaces: &Surfaces,
    objects: &[Object],
    density: f64,
    [size, largest]: [u32; 2],
    most: u64,
) -> Result<Atlas, BakeError> {
    let mut blocks: Vec<Block> = Vec::new();
    let mut of_files = 0;
    for object in objects {
        let stated = object.stated.as_deref().filter(|charts| has_gutters(charts, density, largest));
        of_files += usize::from(stated.is_some());
        match stated {
            Some(charts) => blocks.push(Block { object, charts, sides: sides(charts, density) }),
            None => blocks.extend(object.charts.chunks(1).map(|charts| {
                let sides = sides(charts, density);
                Block { object, charts, sides }
            })),
        }
    }
    for Block { object, sides, .. } in &blocks {
        let texels = sides.iter().copied().max().unwrap_or(0);
        if texels > u64::from(size) {
            let object = surfaces.name(object.object).to_owned();
            return Err(BakeError::TooWide { object, texels, size });
        }
    }
    let texels: u64 = blocks.iter().map(|block| block.sides.iter().product::<u64>()).sum();
    let pages = texels.div_ceil(u64::from(size).pow(2));
    if pages > most {
        return Err(BakeError::TooMany { what: "pages", count: pages, most });
    }
    let (origins, pages) = origins(&blocks, size, most)?;
    let mut charts = Vec::new();
    for (block, (page, origin)) in blocks.iter().zip(origins) {
        charts.extend(block.charts.iter().map(|chart| place(block, chart, density, page, origin)));
    }
    Ok(Atlas { size, pages, density, charts, stated: of_files })
}

/// Sides of the rectangle of charts, with padding, texels.
fn sides(charts: &[Chart], density: f64) -> [u64; 2] {
    let extent = charts.iter().fold(DVec2::ZERO, |extent, chart| extent.max(chart.extent));
    extent.to_array().map(|side| texels(side, density).saturating_add(2 * u64::from(PADDING)))
}

fn texels(side: f64, density: f64) -> u64 {
    ((side * density - SLACK).ceil() as u64).max(1)
}

/// Page and first texel of each block, without padding, and the number of pages.
fn origins(blocks: &[Block], size: u32, most: u64) -> Result<(Vec<Origin>, u32), BakeError> {
    let mut order: Vec<usize> = (0..blocks.len()).collect();
    order.sort_by_key(|&block| {
        let [width, height] = blocks.get(block).map_or([0; 2], |block| block.sides);
        (std::cmp::Reverse((width.max(height), width.min(height))), block)
    });
    let side = size as i32;
    let mut pages: Vec<AtlasAllocator> = Vec::new();
    let mut origins = vec![(0, [0; 2]); blocks.len()];
    for block in order {
        let sides = blocks.get(block).map_or([1; 2], |block| block.sides).map(|side| side as i32);
        let wanted = size2(sides[0], sides[1]);
        let found = (0..).zip(&mut pages).find_map(|(page, atlas)| Some((page, atlas.allocate(wanted)?)));
        let (page, found) = match found {
            Some(found) => found,
            None => {
                pages.push(AtlasAllocator::new(size2(side, side)));
                let last = pages.len() as u32 - 1;
                let Some(found) = pages.last_mut().and_then(|atlas| atlas.allocate(wanted)) else {
                    return Err(BakeError::Size { size });
                };
                (last, found)
            }
        };
        if pages.len() as u64 > most {
            return Err(BakeError::TooMany { what: "pages", count: pages.len() as u64, most });
        }
        if let Some(origin) = origins.get_mut(block) {
            *origin =
                (page, [found.rectangle.min.x, found.rectangle.min.y].map(|side| side as u32 + PADDING));
        }
    }
    Ok((origins, pages.len() as u32))
}

fn place(block: &Block, chart: &Chart, density: f64, page: u32, origin: [u32; 2]) -> PlacedChart {
    let from = DVec2::from_array(origin.map(f64::from));
    let end = [0, 1].map(|axis| origin[axis] + block.sides[axis] as u32 - 2 * PADDING);
    let last = DVec2::from_array(end.map(f64::from));
    let at = |place: DVec2| (from + place * density).clamp(from, last);
    let places: Vec<[DVec2; 3]> = chart.places.iter().map(|places| places.map(at)).collect();
    PlacedChart {
        primitives: chart
            .triangles
            .iter()
            .map(|of| block.object.primitive_of.get(of).copied().unwrap_or(0))
            .collect(),
        triangles: chart.triangles.clone(),
        rectangle: around(&places, [origin, end]),
        places,
        page,
    }
}

/// Texels that places in a rectangle may touch, one at least.
fn around(places: &[[DVec2; 3]], [first, end]: Rectangle) -> Rectangle {
    let [low, high] = bounds(places.as_flattened()).map(|corner| corner.to_array());
    let low = [0, 1].map(|axis| (low[axis].floor() as u32).clamp(first[axis], end[axis].max(1) - 1));
    let high =
        [0, 1].map(|axis| (high[axis].ceil() as u32).clamp(low[axis] + 1, end[axis].max(low[axis] + 1)));
    [low, high]
}

/// Returns whether the parts of a stated layout are apart by two texels at a density.
fn has_gutters(charts: &[Chart], density: f64, size: u32) -> bool {
    let [width, height] = sides(charts, density);
    if width.max(height) > u64::from(size) {
        return false;
    }
    let within = [[0, 0], [width as u32, height as u32]];
    let mut owners: BTreeMap<[i64; 2], usize> = BTreeMap::new();
    for (number, chart) in charts.iter().enumerate() {
        for places in &chart.places {
            for texel in touched(&places.map(|place| place * density), within) {
                let other = *owners.entry(texel.map(i64::from)).or_insert(number);
                if other != number {
                    return false;
                }
            }
        }
    }
    let around = || (-GUTTER..=GUTTER).flat_map(|y| (-GUTTER..=GUTTER).map(move |x| [x, y]));
    charts.len() == 1
        || owners.iter().all(|([x, y], owner)| {
            around().all(|[dx, dy]| owners.get(&[x + dx, y + dy]).is_none_or(|other| other == owner))
        })
}
