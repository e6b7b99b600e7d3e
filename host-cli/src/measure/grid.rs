//! Points on a grid: above a node, or in a rectangle.

use glam::{DVec2, DVec3, Vec3};
use miette::{MietteDiagnostic, Report};
use photoncard_driver::render::measure::{MAX_SENSORS, Point};
use photoncard_driver::scene::{Scene, Triangle};

use crate::failure::Failure;

/// Minimum height of a face's unit normal above which the face is upward.
const MIN_UPWARD: f32 = 0.7;

/// A regular grid.
pub(super) struct Grid<'a> {
    /// Name of a node, or six coordinates of two corners.
    pub(super) place: &'a str,
    /// Distance of the points, metres.
    pub(super) spacing: f64,
    /// Height above the node, metres.
    pub(super) height: f64,
    /// Normal of all points; `None` for that of the grid.
    pub(super) normal: Option<[f64; 3]>,
}

impl Grid<'_> {
    /// Points of the grid: the centres of its cells, row by row.
    pub(super) fn points(&self, scene: &Scene) -> Result<Vec<Point>, Failure> {
        if !(self.spacing.is_finite() && self.spacing > 0.0 && self.height.is_finite()) {
            return Err(refused("a grid has a spacing above 0 metres", "give --spacing 0.5, for instance"));
        }
        let is_node = scene.objects.iter().any(|name| name == self.place);
        let numbers: Option<Vec<f64>> =
            self.place.split(',').map(|number| number.trim().parse().ok()).collect();
        let points = match numbers.as_deref() {
            Some(&[x0, y0, z0, x1, y1, z1]) if !is_node => {
                self.in_rectangle(DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1))?
            }
            _ => self.above_node(scene)?,
        };
        match points.len() {
            0 => Err(refused("the grid has no points", "give a smaller --spacing, or another place")),
            _ => Ok(points),
        }
    }

    fn in_rectangle(&self, a: DVec3, b: DVec3) -> Result<Vec<Point>, Failure> {
        let (low, high) = (a.min(b), a.max(b));
        let flat: Vec<usize> = (0..3).filter(|&axis| low[axis] == high[axis]).collect();
        let ([flat], true) = (&flat[..], low.is_finite() && high.is_finite()) else {
            let text = format!("{} is no rectangle: its corners have not one equal coordinate", self.place);
            return Err(refused(
                &text,
                "give X0,Y0,Z0,X1,Y1,Z1, such as 0,0.8,0,4,0.8,3 for a desk's height",
            ));
        };
        let [across, along] = [(flat + 1) % 3, (flat + 2) % 3];
        let mut normal = DVec3::ZERO;
        normal[*flat] = 1.0;
        let cells = self.cells(DVec2::new(low[across], low[along]), DVec2::new(high[across], high[along]))?;
        let at = |cell: DVec2| {
            let mut place = low;
            (place[across], place[along]) = (cell.x, cell.y);
            self.point(place, normal)
        };
        Ok(cells.map(at).collect())
    }

    /// Points above the upward faces of a node, each at its height above the highest face below it.
    fn above_node(&self, scene: &Scene) -> Result<Vec<Point>, Failure> {
        if !scene.objects.iter().any(|name| name == self.place) {
            let names: Vec<&str> = scene.objects.iter().take(8).map(String::as_str).collect();
            let more = if scene.objects.len() > names.len() { ", ..." } else { "" };
            let text = format!("the scene has no node {} with a mesh", self.place);
            let help = format!("give one of its nodes ({}{more}), or two corners", names.join(", "));
            return Err(refused(&text, &help));
        }
        let is_node = |triangle: &Triangle| {
            scene.objects.get(triangle.object as usize).is_some_and(|name| name == self.place)
        };
        let all = scene.expanded(&vec![true; scene.groups.len()]);
        let is_upward = |triangle: &&Triangle| {
            is_node(triangle) && triangle.scaled_normal().normalize_or_zero().y > MIN_UPWARD
        };
        let faces: Vec<&Triangle> = all.triangles.iter().filter(is_upward).collect();
        let corners = || faces.iter().flat_map(|face| face.vertices).map(|at| scene.in_file(at));
        let Some(low) = corners().reduce(DVec3::min) else {
            let text = format!("no face of the node {} points up", self.place);
            return Err(refused(&text, "give another node, or two corners"));
        };
        let high = corners().fold(low, DVec3::max);
        let cells = self.cells(DVec2::new(low.x, low.z), DVec2::new(high.x, high.z))?;
        let above = |cell: DVec2| {
            let place = scene.in_scene(DVec3::new(cell.x, 0.0, cell.y));
            let heights = faces.iter().filter_map(|face| height_of(face, place));
            let highest = f64::from(heights.reduce(f32::max)?) + scene.offset.y;
            Some(self.point(DVec3::new(cell.x, highest + self.height, cell.y), DVec3::Y))
        };
        Ok(cells.filter_map(above).collect())
    }

    /// Centres of the grid's cells in a rectangle, row by row. The grid lies in its middle.
    fn cells(&self, low: DVec2, high: DVec2) -> Result<impl Iterator<Item = DVec2>, Failure> {
        let numbers = ((high - low) / self.spacing + 1e-9).floor().max(DVec2::ONE);
        if numbers.x * numbers.y > f64::from(MAX_SENSORS) {
            let text = format!("the grid has {} points, more than {MAX_SENSORS}", numbers.x * numbers.y);
            return Err(refused(&text, "give a greater --spacing"));
        }
        let [columns, rows] = numbers.to_array().map(|number| number as u32);
        let first = (low + high - (numbers - 1.0) * self.spacing) * 0.5;
        let spacing = self.spacing;
        let at = move |row, column| first + DVec2::new(f64::from(column), f64::from(row)) * spacing;
        Ok((0..rows).flat_map(move |row| (0..columns).map(move |column| at(row, column))))
    }

    fn point(&self, position: DVec3, normal: DVec3) -> Point {
        // Tables show no rounding errors: nanometres.
        let rounded = |coordinate: f64| (coordinate * 1e9).round() / 1e9;
        Point { position: position.to_array().map(rounded), normal: self.normal.unwrap_or(normal.to_array()) }
    }
}

/// Height of a face at the place `(x, z)`, in the scene's coordinates; `None` beside the face.
fn height_of(face: &Triangle, place: Vec3) -> Option<f32> {
    let [a, b, c] = face.vertices.map(|corner| corner - place);
    let cross = |p: Vec3, q: Vec3| p.x * q.z - p.z * q.x;
    let weights = [cross(b, c), cross(c, a), cross(a, b)];
    let all: f32 = weights.iter().sum();
    let is_inside = all != 0.0 && weights.iter().all(|weight| weight / all >= 0.0);
    let height =
        || weights.iter().zip(face.vertices).map(|(weight, corner)| weight / all * corner.y).sum::<f32>();
    is_inside.then(height)
}

fn refused(text: &str, help: &str) -> Failure {
    Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help)))
}
