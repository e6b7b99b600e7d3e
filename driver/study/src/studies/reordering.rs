//! Study of the photon map's memory traffic by order of the gathers, cache, and layout of the map.

use photoncard_cards::scheduler::GatherOrder;
use photoncard_firmware::memory::SetIndex;
use photoncard_map::photon_map::PhotonLayout;
use photoncard_picture::choice::Choice;
use photoncard_render::emulator::memory_model::{CacheSettings, CacheSpec};

use super::super::laboratory::Results;
use super::super::measure::{Measurement, TileMeasurement};
use super::super::point::{ALONG_CURVE, Point};
use super::super::report::{Block, Cell, Column, Figure, Report, Series, Table, XScale, YScale};
use super::super::sample::{Estimate, Ratio};
use super::super::scale::{Scale, TILE};
use super::overlap;
use super::present::{
    CORNELL, GIGA, cell, columns, gigabyte_point, gigabytes, how_it_counts, key, page, panel, plot, say,
    section, series, table, text,
};
use super::times::{self, TimedFrame};

/// Order of gathers in a table's row: an order that chips support, or `None` for all gathers of the frame
/// along one curve.
type Order = Option<GatherOrder>;

fn name(order: Order) -> &'static str {
    order.map_or(ALONG_CURVE, Choice::name)
}

/// Orders of gathers that a chip supports.
const ORDERS: [GatherOrder; 5] = [
    GatherOrder::Naive,
    GatherOrder::Tiled,
    GatherOrder::DirectionBins,
    GatherOrder::Hash,
    GatherOrder::Sort,
];
/// Orders whose traffic is measured with several caches. `tiled` reads about as much as `naive`.
const CACHED_ORDERS: [GatherOrder; 4] =
    [GatherOrder::Naive, GatherOrder::DirectionBins, GatherOrder::Hash, GatherOrder::Sort];
const LAYOUTS: [PhotonLayout; 2] = [PhotonLayout::Jensen, PhotonLayout::Lines];
/// Side of tiles between the dissertation's and the largest, pixels.
const LARGER_TILE: u32 = 32;
/// Published bytes per frame (Graphics Interface 2005): requested in the naive order, fetched from DRAM in
/// the practical orders, and fetched from DRAM along a Hilbert curve.
const PUBLISHED: [f64; 3] = [196e9, 24e9, 15e6];

/// Orders that a chip supports, each with both layouts.
fn lines() -> Vec<(GatherOrder, PhotonLayout)> {
    LAYOUTS.into_iter().flat_map(|layout| ORDERS.map(|order| (order, layout))).collect()
}

/// Sides of tiles, pixels: the dissertation's, a larger one, and the largest that the chip can render.
fn tiles(scale: &Scale) -> Vec<u32> {
    let widest = scale.widest_tile();
    let mut tiles = vec![TILE, LARGER_TILE, widest];
    tiles.retain(|&side| side == TILE || side <= widest);
    tiles.dedup();
    tiles
}

/// Sizes of the photon cache, KB.
const SIZES: [u32; 3] = [32, 128, 512];

/// Photon caches with 1, 4 and 32 ways, and with 32 ways and a hashed set index, with their names.
fn associativities() -> [(String, CacheSettings); 4] {
    let of = |ways, index| behind(CacheSpec { ways, index, ..CacheSpec::PHOTON });
    [
        ("1 way".to_owned(), of(1, SetIndex::Modulo)),
        ("4 ways".to_owned(), of(4, SetIndex::Modulo)),
        ("32 ways".to_owned(), of(32, SetIndex::Modulo)),
        ("32 ways, hashed".to_owned(), of(32, SetIndex::Hashed)),
    ]
}

fn of_size(kilobytes: u32) -> CacheSettings {
    behind(CacheSpec { bytes: kilobytes << 10, ..CacheSpec::PHOTON })
}

fn behind(photon: CacheSpec) -> CacheSettings {
    CacheSettings::Split {
        photon,
        scene: CacheSpec { index: photon.index, ..CacheSpec::SCENE },
        by_work: None,
    }
}

fn point(scale: &Scale, order: Order, layout: PhotonLayout, caches: CacheSettings) -> Point {
    let settings = scale.settings(order.unwrap_or(GatherOrder::Sort)).with(|s| s.photons.layout = layout);
    match order {
        Some(_) => scale.traffic_behind(CORNELL, settings, caches),
        // No chip has room for the gathers of a frame: the bound is the reference chip's.
        None => Point {
            is_along_curve: true,
            ..Scale { model: None, ..scale.clone() }.traffic_behind(CORNELL, settings, caches)
        },
    }
}

/// Point with sorted gathers in tiles of `tile` x `tile` pixels.
fn sorted(scale: &Scale, layout: PhotonLayout, tile: u32) -> Point {
    let settings = scale.settings(GatherOrder::Sort).with(|s| {
        s.photons.layout = layout;
        s.schedule.tile = Some(tile);
    });
    scale.traffic(CORNELL, settings)
}

pub(super) fn points(scale: &Scale) -> Vec<Point> {
    let mut points = Vec::new();
    for order in CACHED_ORDERS {
        let caches = SIZES.map(of_size).into_iter().chain(associativities().map(|(_, caches)| caches));
        points.extend(caches.map(|caches| point(scale, Some(order), PhotonLayout::Jensen, caches)));
    }
    for order in ORDERS {
        points.extend(LAYOUTS.map(|layout| point(scale, Some(order), layout, scale.caches())));
    }
    for layout in LAYOUTS {
        points.extend(tiles(scale).into_iter().map(|tile| sorted(scale, layout, tile)));
    }
    points.extend(overlap::points(scale, &lines()));
    points.extend(LAYOUTS.map(|layout| point(scale, None, layout, scale.caches())));
    points
}

pub(super) fn report(scale: &Scale, results: &Results) -> Report {
    let nominal = |order, layout| {
        let point = point(scale, order, layout, scale.caches());
        results.traffic(&point)
    };
    let introduction = vec![
        "How the order in which photons are gathered changes the memory traffic of the photon map: the Cornell box, one \
         frame, without importance sampling and irradiance cache. The picture is the same, bit for bit, in every row."
            .to_owned(),
        how_it_counts(),
        "The order hilbert sorts all gathers of the frame, which no chip has room for: a bound. It is not sampled."
            .to_owned(),
    ];
    let mut by_order = vec![
        table("orders", orders(scale, &nominal)),
        plot_of_orders(&nominal),
        table("gathers", by_gather(scale, &nominal)),
        text(share_of_gathers(scale, &nominal)),
        table("times", by_time(scale, &nominal)),
        text(times::assumptions(&scale.machine)),
    ];
    if scale.is_nominal() {
        by_order.extend([text(comparison(scale)), table("published", published(scale, &nominal))]);
    }
    let sections = vec![
        section("Orders", by_order),
        section("Rays cast while the queue drains", overlap::blocks(scale, results, &lines())),
        section("Larger tiles", vec![table("tiles", by_tile(scale, results, &nominal))]),
        section("Size of the photon cache", by_size(scale, results)),
        section("Associativity and index", by_associativity(scale, results)),
    ];
    let figures = figures(scale, results, &nominal);
    Report { figures, ..page("Reordering photon gathers", introduction, sections) }
}

/// Key figures: bytes of the photon map by the order of gathers, in Jensen's layout with the chip's caches.
fn figures<'a>(
    scale: &Scale,
    results: &Results,
    nominal: &impl Fn(Order, PhotonLayout) -> &'a Measurement,
) -> Vec<Figure> {
    let figure = |quantity: &str, order, bytes: Estimate| {
        let Estimate { value, half_width } = bytes.scaled(1.0 / GIGA);
        let name = format!("reordering.{quantity}.{}", name(order));
        Figure::new(name, key(CORNELL), value, "GB").within(value - half_width, value + half_width)
    };
    let naive = Some(GatherOrder::Naive);
    let raw = figure("raw-gigabytes", naive, nominal(naive, PhotonLayout::Jensen).raw_bytes());
    let of_order =
        |order| figure("gigabytes", order, nominal(order, PhotonLayout::Jensen).photon_map_bytes());
    let gathers = |tile: &TileMeasurement| tile.counters.gathers as f64;
    let Ratio { value, lower, upper } =
        nominal(naive, PhotonLayout::Jensen).ratio(|tile| tile.photon_map().raw_bytes as f64, gathers);
    let of_gather = Figure::new("reordering.raw-bytes-of-a-gather.naive", key(CORNELL), value, "bytes");
    let of_gather = of_gather.within(lower, upper);
    let bound = figure("gigabytes", None, nominal(None, PhotonLayout::Lines).photon_map_bytes());
    let bound = Figure { name: format!("{}-lines", bound.name), ..bound };
    let [.., (_, many_ways)] = associativities();
    let many_ways = point(scale, Some(GatherOrder::Hash), PhotonLayout::Jensen, many_ways);
    let many_ways = results.traffic(&many_ways).photon_map_bytes();
    let many_ways =
        Figure { name: "reordering.gigabytes.hash-32-ways-hashed".to_owned(), ..figure("", None, many_ways) };
    ORDERS
        .map(Some)
        .into_iter()
        .chain([None])
        .map(of_order)
        .chain([raw, of_gather, bound, many_ways])
        .collect()
}

/// Table with a row for every order and layout, measured with the nominal caches.
fn by_order<'a>(
    title: &str,
    heads: &[(&str, &str)],
    nominal: &impl Fn(Order, PhotonLayout) -> &'a Measurement,
    cells: impl Fn(Order, PhotonLayout, &Measurement) -> Vec<Cell>,
) -> Table {
    let mut table = Table::new(title, columns(&[&[("order", ""), ("photon map", "")], heads].concat()));
    for order in ORDERS.map(Some).into_iter().chain([None]) {
        for layout in LAYOUTS {
            let mut row = vec![name(order).into(), layout.name().into()];
            row.extend(cells(order, layout, nominal(order, layout)));
            table.push(row);
        }
    }
    table
}

fn orders<'a>(scale: &Scale, nominal: &impl Fn(Order, PhotonLayout) -> &'a Measurement) -> Table {
    let naive = nominal(Some(GatherOrder::Naive), PhotonLayout::Jensen).photon_map_bytes().value;
    let heads =
        [("gathers", "million"), ("raw", "GB"), ("from DRAM", "GB"), ("less than naive, jensen", "times")];
    let title = match &scale.model {
        None => "Photon map traffic of a frame, cache 128 KB, lines of 128 bytes, 4 ways".to_owned(),
        Some(_) => format!("Photon map traffic of a frame, caches {}", scale.caches()),
    };
    by_order(&title, &heads, nominal, |_, _, measured| {
        let dram = measured.photon_map_bytes();
        let factor = naive / dram.value;
        vec![cell(measured.gathers(), 1e6), gigabytes(measured.raw_bytes()), gigabytes(dram), factor.into()]
    })
}

/// Table of the traffic of sorted gathers by the side of a tile. Each tile reads about the whole map once.
fn by_tile<'a>(
    scale: &Scale,
    results: &Results,
    nominal: &impl Fn(Order, PhotonLayout) -> &'a Measurement,
) -> Table {
    let naive = nominal(Some(GatherOrder::Naive), PhotonLayout::Jensen);
    let of_gather = |measured: &Measurement| measured.photon_map_bytes().value / measured.gathers().value;
    let heads = [
        ("side of a tile", "pixels"),
        ("photon map", ""),
        ("from DRAM", "GB"),
        ("from DRAM", "bytes a gather"),
        ("less than naive, jensen, a gather", "times"),
    ];
    let mut table = Table::new("Sorted gathers, the queue drained when it is full", columns(&heads));
    for layout in LAYOUTS {
        for tile in tiles(scale) {
            let measured = results.traffic(&sorted(scale, layout, tile));
            table.push(vec![
                tile.into(),
                layout.name().into(),
                gigabytes(measured.photon_map_bytes()),
                of_gather(measured).into(),
                (of_gather(naive) / of_gather(measured)).into(),
            ]);
        }
    }
    table
}

fn by_time<'a>(scale: &Scale, nominal: &impl Fn(Order, PhotonLayout) -> &'a Measurement) -> Table {
    let heads = times::heads(&scale.machine);
    let heads: Vec<_> = heads.iter().map(|(name, unit)| (name.as_str(), *unit)).collect();
    by_order("Time of one chip for the frame", &heads, nominal, |order, layout, measured| {
        let point = point(scale, order, layout, scale.caches());
        times::cells(&TimedFrame::new(&point, measured, &scale.machine))
    })
}

fn by_gather<'a>(scale: &Scale, nominal: &impl Fn(Order, PhotonLayout) -> &'a Measurement) -> Table {
    let heads = [
        ("raw", "bytes a gather"),
        ("from DRAM", "bytes a gather"),
        ("raw at all rays' gathers", "GB"),
        ("from DRAM at all rays' gathers", "GB"),
    ];
    by_order("The same for each gather", &heads, nominal, |_, _, measured| {
        let gathers = measured.gathers().value;
        let of_gather =
            [measured.raw_bytes(), measured.photon_map_bytes()].map(|bytes| bytes.value / gathers);
        let of_all = of_gather.map(|bytes| bytes * scale.nominal_gathers() / GIGA);
        of_gather.into_iter().chain(of_all).map(Cell::from).collect()
    })
}

fn plot_of_orders<'a>(nominal: &impl Fn(Order, PhotonLayout) -> &'a Measurement) -> Block {
    let orders: Vec<_> = ORDERS.map(Some).into_iter().chain([None]).collect();
    let names = orders.iter().map(|&order| name(order).to_owned()).collect();
    let mut lines = Vec::new();
    for layout in LAYOUTS {
        let of = |bytes: fn(&Measurement) -> Estimate| {
            let point = |(index, &order)| gigabyte_point(index as f64, bytes(nominal(order, layout)));
            orders.iter().enumerate().map(point).collect()
        };
        lines.push(series(format!("raw, {}", layout.name()), of(Measurement::raw_bytes)));
        lines.push(series(format!("from DRAM, {}", layout.name()), of(Measurement::photon_map_bytes)));
    }
    plot(
        "orders",
        "Photon map traffic by order",
        "Raw bytes hardly depend on the order; what misses the cache does.",
        vec![panel(
            "",
            ("order", "", XScale::Categories(names)),
            ("photon map", "GB a frame", YScale::Log10),
            lines,
        )],
    )
}

/// Paragraph on the fraction of the rays that end in a gather.
fn share_of_gathers<'a>(scale: &Scale, nominal: &impl Fn(Order, PhotonLayout) -> &'a Measurement) -> String {
    let naive = nominal(Some(GatherOrder::Naive), PhotonLayout::Jensen);
    let gathers = naive.gathers().value;
    let rays = naive.total(|tile| tile.counters.gather_rays as f64).value;
    let all = scale.nominal_gathers();
    format!(
        "Of the {} million gather rays that every pixel together could cast, {} million are cast, as the box does not fill \
         the picture, and {} million end in a gather, as it is open in front: {} %.",
        say(all / 1e6),
        say(rays / 1e6),
        say(gathers / 1e6),
        say(100.0 * gathers / all),
    )
}

/// Paragraph on the comparison with published figures.
fn comparison(scale: &Scale) -> String {
    format!(
        "Published figures are of frames whose rays all end in a gather, so the table below compares with them both as counted \
         and in proportion to all rays. The published raw bytes follow from 20-byte photons, {} neighbours and {} rays; the \
         other figures depend on choices that were not published: the layout's order in memory, the cache's associativity, \
         bins, hash and queue.",
        scale.neighbors, scale.gather_rays,
    )
}

fn published<'a>(scale: &Scale, nominal: &impl Fn(Order, PhotonLayout) -> &'a Measurement) -> Table {
    let heads = [
        ("quantity", ""),
        ("published, 512x512 pixels", "GB"),
        ("order here", ""),
        ("photon map", ""),
        ("as counted", "GB"),
        ("at all rays' gathers", "GB"),
    ];
    let mut table = Table::new("Figures of Graphics Interface 2005", columns(&heads));
    let [raw, practical, bound] = PUBLISHED;
    let mut row = |quantity: &str, published: f64, order, layout, is_raw: bool| {
        let measured = nominal(order, layout);
        let bytes = if is_raw { measured.raw_bytes() } else { measured.photon_map_bytes() };
        let at_all = bytes.scaled(scale.nominal_gathers() / measured.gathers().value);
        table.push(vec![
            quantity.into(),
            (published / GIGA).into(),
            name(order).into(),
            layout.name().into(),
            gigabytes(bytes),
            Cell::from(at_all.value / GIGA),
        ]);
    };
    use GatherOrder::{DirectionBins, Hash, Naive, Sort};
    row("raw, naive", raw, Some(Naive), PhotonLayout::Jensen, true);
    for order in [DirectionBins, Hash, Sort] {
        row("from DRAM, practical orders", practical, Some(order), PhotonLayout::Jensen, false);
    }
    for layout in LAYOUTS {
        row("from DRAM, frame along a Hilbert curve", bound, None, layout, false);
    }
    table
}

/// Table with a row for each order and a column for each cache.
fn by_caches(title: &str, scale: &Scale, results: &Results, caches: &[(String, CacheSettings)]) -> Table {
    let mut heads = vec![Column::new("order", "")];
    heads.extend(caches.iter().map(|(name, _)| Column::new(name.as_str(), "GB")));
    let mut table = Table::new(title, heads);
    for order in CACHED_ORDERS {
        let mut row = vec![order.name().into()];
        row.extend(caches.iter().map(|&(_, caches)| {
            let point = point(scale, Some(order), PhotonLayout::Jensen, caches);
            gigabytes(results.traffic(&point).photon_map_bytes())
        }));
        table.push(row);
    }
    table
}

/// Series of plots, one per order: bytes of the photon map fetched from DRAM, over `caches`. The number of
/// each of `caches` is its horizontal position.
fn lines_by_caches(scale: &Scale, results: &Results, caches: &[(f64, CacheSettings)]) -> Vec<Series> {
    let line = |order: GatherOrder| {
        let points = caches.iter().map(|&(x, caches)| {
            let point = point(scale, Some(order), PhotonLayout::Jensen, caches);
            gigabyte_point(x, results.traffic(&point).photon_map_bytes())
        });
        series(order.name(), points.collect())
    };
    CACHED_ORDERS.map(line).to_vec()
}

fn by_size(scale: &Scale, results: &Results) -> Vec<Block> {
    let caches = SIZES.map(|size| (format!("{size} KB"), of_size(size)));
    let places = SIZES.map(|size| (f64::from(size), of_size(size)));
    let lines = lines_by_caches(scale, results, &places);
    let axes = panel(
        "",
        ("photon cache, 4 ways", "KB", XScale::Log2),
        ("photon map from DRAM", "GB a frame", YScale::Log10),
        lines,
    );
    let caption = "Jensen's kd-tree, lines of 128 bytes.";
    vec![
        plot("cache-size", "Traffic by the size of the photon cache", caption, vec![axes]),
        table("cache-size", by_caches("Photon map from DRAM by cache size, 4 ways", scale, results, &caches)),
    ]
}

fn by_associativity(scale: &Scale, results: &Results) -> Vec<Block> {
    let caches = associativities();
    let places: Vec<_> =
        caches.iter().enumerate().map(|(index, &(_, caches))| (index as f64, caches)).collect();
    let names = caches.iter().map(|(name, _)| name.clone()).collect();
    let lines = lines_by_caches(scale, results, &places);
    let axes = panel(
        "",
        ("sets of the photon cache, 128 KB", "", XScale::Categories(names)),
        ("photon map from DRAM", "GB a frame", YScale::Log10),
        lines,
    );
    let caption = "Jensen's kd-tree, lines of 128 bytes. Where not hashed, a line's set is its address modulo their number.";
    vec![
        plot("associativity", "Traffic by the associativity of the photon cache", caption, vec![axes]),
        table(
            "associativity",
            by_caches("Photon map from DRAM by associativity, 128 KB", scale, results, &caches),
        ),
    ]
}
