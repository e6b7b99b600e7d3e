use super::super::markup::reader::{Element, elements};
use super::*;

fn series(name: &str, points: &[(f64, f64)]) -> Series {
    let points = points.iter().map(|&(x, y)| Point::with_half_width(x, y, 0.1 * y)).collect();
    Series { name: name.to_owned(), points }
}

fn panel(x: XScale, y: YScale, series: Vec<Series>) -> Panel {
    Panel {
        title: "Left & <right> \"half\"".to_owned(),
        x: XAxis { label: "chips".to_owned(), unit: String::new(), scale: x },
        y: YAxis { label: "time per <pixel>".to_owned(), unit: "µs & more".to_owned(), scale: y },
        series,
    }
}

fn plot(panels: Vec<Panel>) -> Plot {
    Plot {
        title: "Scaling of 'sort' & \"hash\" <with cards>".to_owned(),
        caption: "Higher is <better>.".to_owned(),
        panels,
        shares_y_range: true,
    }
}

fn names(names: &[&str]) -> XScale {
    XScale::Categories(names.iter().map(|&name| name.to_owned()).collect())
}

const ORDERS: [&str; 6] = ["naive", "tiled", "dirbin", "hash", "sort", "hilbert"];

/// Common, degenerate and invalid data.
fn nasty_points() -> Vec<Vec<(f64, f64)>> {
    let (nan, infinity) = (f64::NAN, f64::INFINITY);
    vec![
        vec![],
        vec![(1.0, 1.0)],
        vec![(0.0, 0.0)],
        vec![(1.0, 7.0), (2.0, 7.0), (3.0, 7.0)],
        vec![(2.0, 1.0), (2.0, 2.0)],
        vec![(0.0, 0.0), (1.0, 0.0), (2.0, 5.0), (4.0, 0.001)],
        vec![(1.0, nan), (2.0, infinity), (nan, 1.0), (-infinity, 1.0)],
        vec![(0.0, 1.0), (1.0, nan), (2.0, 3.0), (3.0, -4.0)],
        vec![(1.0, f64::MAX), (2.0, f64::MIN), (3.0, f64::MIN_POSITIVE), (4.0, 5e-324)],
        vec![(1e300, 1e300), (-1e300, -1e300), (1e-300, 1e-300)],
        vec![(1.0, 1e15), (2.0, 1e15 + 1.0)],
        vec![(1.0, 3e9), (128.0, 4e-9)],
        vec![(1e-9, 1e6), (1e9, 9e6)],
        (0..8).map(|power| (2_f64.powi(power), 180.0 / f64::from(power + 1))).collect(),
    ]
}

fn all_scales() -> Vec<(XScale, YScale)> {
    let x = || vec![XScale::Linear, XScale::Log2, XScale::Log10, names(&ORDERS), names(&[])];
    let y = [YScale::Linear, YScale::LinearFromZero, YScale::Log10];
    y.into_iter().flat_map(|y| x().into_iter().map(move |x| (x, y))).collect()
}

/// Plots of one panel and of two panels for each kind of axes and data, and one with long names.
fn nasty_plots() -> Vec<Plot> {
    let mut plots = vec![plot(vec![])];
    for (x, y) in all_scales() {
        for points in nasty_points() {
            let one = panel(x.clone(), y, vec![series("a <b> & \"c\" 'd'\u{1}", &points)]);
            plots.push(plot(vec![one]));
        }
        let many: Vec<_> = nasty_points().iter().map(|points| series("many", points)).collect();
        let other = panel(x.clone(), YScale::Linear, vec![]);
        plots.push(plot(vec![panel(x, y, many), other]));
    }
    let long = "a_very_long_name_".repeat(12);
    let long_names: Vec<_> = (0..12).map(|index| format!("{index} {long} and words {long}")).collect();
    let series: Vec<_> = long_names.iter().map(|name| series(name, &[(1.0, 2.0), (0.0, 3.0)])).collect();
    let categories: Vec<&str> = long_names.iter().map(String::as_str).collect();
    let mut long_plot = plot(vec![panel(names(&categories), YScale::Linear, series); 3]);
    long_plot.title = long.clone();
    long_plot.panels[0].title = long.clone();
    long_plot.panels[0].x.label = long.clone();
    long_plot.panels[0].y.label = long;
    plots.push(long_plot);
    plots
}

fn view_box(svg: &[Element]) -> [f64; 2] {
    let numbers: Vec<f64> =
        svg[0].get("viewBox").unwrap().split(' ').map(|number| number.parse().unwrap()).collect();
    assert_eq!(numbers[..2], [0.0, 0.0]);
    [numbers[2], numbers[3]]
}

/// Left, top, right and bottom of a text, with the upper bound of its width that the layout assumes.
fn text_box(element: &Element) -> [f64; 4] {
    let [x, y, size] = ["x", "y", "font-size"].map(|name| element.number(name).unwrap());
    let width = text::width(&element.text.trim_end_matches('\n').replace('\n', " "), size);
    let width = if element.get("font-weight").is_some() { text::BOLD * width } else { width };
    let start = match element.get("text-anchor").unwrap() {
        "start" => 0.0,
        "middle" => -0.5 * width,
        _ => -width,
    };
    let turn = element.get("transform").map_or(0.0, |transform| {
        let degrees = transform.strip_prefix("rotate(").unwrap().split(' ').next().unwrap();
        degrees.parse::<f64>().unwrap().to_radians()
    });
    let corners = [
        (start, -0.8 * size),
        (start, 0.2 * size),
        (start + width, -0.8 * size),
        (start + width, 0.2 * size),
    ];
    let mut bounds = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    for (along, across) in corners {
        let corner_x = x + along * turn.cos() - across * turn.sin();
        let corner_y = y + along * turn.sin() + across * turn.cos();
        bounds = [
            bounds[0].min(corner_x),
            bounds[1].min(corner_y),
            bounds[2].max(corner_x),
            bounds[3].max(corner_y),
        ];
    }
    bounds
}

/// Points in the attributes of an element.
fn coordinates(element: &Element) -> Vec<[f64; 2]> {
    let number = |name: &str| element.number(name).unwrap();
    match element.tag.as_str() {
        "line" => vec![[number("x1"), number("y1")], [number("x2"), number("y2")]],
        "rect" => {
            let [x, y] = [number("x"), number("y")];
            vec![[x, y], [x + number("width"), y + number("height")]]
        }
        "text" => {
            let [left, top, right, bottom] = text_box(element);
            vec![[left, top], [right, bottom]]
        }
        "path" => {
            let mut numbers = Vec::new();
            let mut parts = element.get("d").unwrap().split(' ');
            while let Some(part) = parts.next() {
                if part.starts_with('A') {
                    parts.by_ref().take(4).for_each(drop);
                } else if part != "Z" {
                    numbers.push(part.trim_start_matches(['M', 'L']).parse::<f64>().unwrap());
                }
            }
            assert_eq!(numbers.len() % 2, 0);
            numbers.chunks(2).map(|point| [point[0], point[1]]).collect()
        }
        _ => vec![],
    }
}

#[test]
fn every_plot_is_well_formed_and_lies_inside_its_view_box() {
    for plot in nasty_plots() {
        let svg = elements(&plot.to_svg());
        assert_eq!((svg[0].tag.as_str(), svg[0].get("role")), ("svg", Some("img")));
        assert_eq!((svg[1].tag.as_str(), svg[1].text.trim()), ("title", plot.title.as_str()));
        assert_eq!(svg[2].tag, "desc");
        let [width, height] = view_box(&svg);
        for element in &svg {
            for [x, y] in coordinates(element) {
                let is_inside = (0.0..=width).contains(&x) && (0.0..=height).contains(&y);
                assert!(is_inside, "({x}, {y}) of {element:?} in {width} x {height}");
            }
        }
    }
}

fn of_class<'a>(svg: &'a [Element], class: &str) -> Vec<&'a Element> {
    svg.iter().filter(|element| element.get("class") == Some(class)).collect()
}

/// Returns whether two parallel lines of text do not overlap.
fn are_apart(a: &Element, b: &Element) -> bool {
    let (p, q) = (text_box(a), text_box(b));
    if a.get("transform").is_some() {
        let across = (b.number("x").unwrap() - a.number("x").unwrap()).abs() * 0.5_f64.sqrt();
        return across >= a.number("font-size").unwrap() || p[1] > q[3] || q[1] > p[3];
    }
    p[2] < q[0] || q[2] < p[0] || p[3] < q[1] || q[3] < p[1]
}

#[test]
fn tick_labels_do_not_overlap() {
    for plot in nasty_plots() {
        let svg = elements(&plot.to_svg());
        for class in ["x-tick", "y-tick"] {
            let labels = of_class(&svg, class);
            for (index, a) in labels.iter().enumerate() {
                assert!(labels[index + 1..].iter().all(|b| are_apart(a, b)), "{a:?} in {labels:?}");
            }
        }
    }
}

#[test]
fn labels_overlap_neither_each_other_nor_the_legend() {
    for plot in nasty_plots() {
        let svg = elements(&plot.to_svg());
        let bottom = of_class(&svg, "x-tick").into_iter().map(|label| text_box(label)[3]).fold(0.0, f64::max);
        let label_bottom = svg
            .iter()
            .filter(|element| element.get("class") == Some("label") && element.get("transform").is_none());
        let label_bottom = label_bottom.map(|label| text_box(label)[3]).fold(0.0, f64::max);
        for name in of_class(&svg, "name") {
            assert!(text_box(name)[1] > bottom.max(label_bottom));
        }
        let names = of_class(&svg, "name");
        for (index, a) in names.iter().enumerate() {
            assert!(names[index + 1..].iter().all(|b| are_apart(a, b)), "{a:?}");
        }
    }
}

fn twelve() -> Plot {
    let names: Vec<_> = (0..12).map(|index| format!("series {index}")).collect();
    let series: Vec<_> = names
        .iter()
        .enumerate()
        .map(|(index, name)| series(name, &[(1.0, index as f64), (2.0, 2.0 * index as f64)]))
        .collect();
    plot(vec![panel(XScale::Log2, YScale::LinearFromZero, series)])
}

/// Shape of a marker relative to its first point, and whether it is hollow.
fn shape(marker: &Element) -> (Vec<[i32; 2]>, bool) {
    let points = coordinates(marker);
    let first = points[0];
    let relative = |[x, y]: [f64; 2]| [x - first[0], y - first[1]].map(|side| (10.0 * side).round() as i32);
    let is_hollow = marker.get("fill") == Some("#ffffff");
    (points.into_iter().map(relative).collect(), is_hollow)
}

#[test]
fn series_can_be_distinguished_without_colours() {
    let svg = elements(&twelve().to_svg());
    let mut looks = Vec::new();
    for (index, element) in svg.iter().enumerate() {
        if element.get("class") == Some("legend") {
            let (line, marker, name) = (&svg[index + 1], &svg[index + 2], &svg[index + 3]);
            looks.push((line.get("stroke-dasharray").map(str::to_owned), shape(marker)));
            assert_eq!(name.text.trim(), format!("series {}", looks.len() - 1));
        }
    }
    assert_eq!(looks.len(), 12);
    for (index, look) in looks.iter().enumerate() {
        assert!(!looks[index + 1..].contains(look), "{index}: {look:?}");
    }
    let colours: std::collections::HashSet<_> =
        of_class(&svg, "marker").into_iter().filter_map(|marker| marker.get("stroke")).collect();
    assert_eq!(colours.len(), 12);
}

#[test]
fn a_series_looks_the_same_in_every_panel_and_is_once_in_the_legend() {
    let [a, b] = ["a", "b"].map(|name| series(name, &[(1.0, 1.0)]));
    let both = vec![
        panel(XScale::Linear, YScale::Linear, vec![a.clone(), b.clone()]),
        panel(XScale::Linear, YScale::Linear, vec![b, a]),
    ];
    let svg = elements(&plot(both).to_svg());
    let looks: Vec<_> = of_class(&svg, "marker").into_iter().map(shape).collect();
    let [left_a, left_b, right_b, right_a, legend_a, legend_b] = looks.try_into().unwrap();
    assert_eq!((&left_a, &left_b), (&right_a, &right_b));
    assert_eq!((left_a, left_b), (legend_a, legend_b));
    assert_eq!(of_class(&svg, "legend").len(), 2);
}

#[test]
fn omitted_points_are_reported_and_interrupt_the_line() {
    let points = [(1.0, 1.0), (2.0, 2.0), (3.0, 0.0), (4.0, f64::NAN), (5.0, 1.0), (6.0, -1.0), (7.0, 2.0)];
    let svg =
        elements(&plot(vec![panel(XScale::Linear, YScale::Log10, vec![series("a", &points)])]).to_svg());
    let notes: Vec<_> = of_class(&svg, "note").into_iter().map(|note| note.text.trim()).collect();
    assert_eq!(
        notes,
        [
            "Left out: 1 point of a (not finite).",
            "Left out: 2 points of a (zero or less, on a logarithmic axis)."
        ]
    );
    // Five markers: four points, and one in the legend. Two lines: through the only run of several points,
    // and in the legend.
    assert_eq!((of_class(&svg, "marker").len(), of_class(&svg, "line").len()), (5, 2));
    let names =
        plot(vec![panel(names(&ORDERS), YScale::Linear, vec![series("a", &[(0.5, 1.0), (6.0, 1.0)])])]);
    assert!(names.to_svg().contains("Left out: 2 points of a (in no category)."));
    assert!(names.to_svg().contains("no data"));
    assert!(!twelve().to_svg().contains("Left out"));
}

#[test]
fn panels_share_the_vertical_range_if_asked_to() {
    let low = panel(XScale::Linear, YScale::Linear, vec![series("a", &[(1.0, 1.0), (2.0, 2.0)])]);
    let high = panel(XScale::Linear, YScale::Linear, vec![series("a", &[(1.0, 80.0), (2.0, 90.0)])]);
    let mut plot = plot(vec![low, high]);
    let ticks = |plot: &Plot| {
        let svg = elements(&plot.to_svg());
        of_class(&svg, "y-tick").into_iter().map(|tick| tick.text.clone()).collect::<Vec<_>>()
    };
    let shared = ticks(&plot);
    assert_eq!(shared[..shared.len() / 2], shared[shared.len() / 2..]);
    plot.shares_y_range = false;
    assert_ne!(ticks(&plot)[0], ticks(&plot)[ticks(&plot).len() - 1]);
    assert_ne!(ticks(&plot), shared);
}

#[test]
fn an_error_bar_beyond_a_logarithmic_axis_ends_at_its_border() {
    let points = vec![Point::with_half_width(1.0, 10.0, 20.0), Point::with_half_width(2.0, 10.0, 5.0)];
    let series = Series { name: "a".to_owned(), points };
    let svg = elements(&plot(vec![panel(XScale::Linear, YScale::Log10, vec![series])]).to_svg());
    // The first bar has only its upper cap, the second has both: five segments.
    assert_eq!(of_class(&svg, "bar").len(), 5);
}
