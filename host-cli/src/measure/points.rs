//! Points of a measurement, read line by line.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use miette::{MietteDiagnostic, Report};
use photoncard_driver::render::measure::Point;

use crate::failure::Failure;

/// Maximum length of a line, bytes.
const MAX_LINE: u64 = 4096;
/// Names of the columns of x, y, z and the normal: those of this program's tables, and others.
const NAMES: [[&str; 3]; 6] = [
    ["x", "px", "x_m"],
    ["y", "py", "y_m"],
    ["z", "pz", "z_m"],
    ["nx", "dx", "xd"],
    ["ny", "dy", "yd"],
    ["nz", "dz", "zd"],
];

/// Reader of points: six numbers a line, separated by blanks or commas. If the first line is not of numbers,
/// it names the columns, of which there may then be more. Empty lines and lines that begin with `#` are left
/// out.
pub(super) struct Points {
    path: PathBuf,
    input: Box<dyn BufRead + Send>,
    /// Number of the line that was read last.
    line: u64,
    /// Columns of the numbers that are read, six or three; `None` before the first line.
    columns: Option<Vec<usize>>,
    /// True if the first line names the columns.
    are_named: bool,
    /// True if only positions are read.
    are_places: bool,
}

impl Points {
    /// Opens a file, or standard input for `-`. With `are_places` lines need no normals, and points face up.
    pub(super) fn open(path: &Path, are_places: bool) -> Result<Self, Failure> {
        let input: Box<dyn BufRead + Send> = if path.as_os_str() == "-" {
            Box::new(BufReader::new(io::stdin()))
        } else {
            Box::new(BufReader::new(File::open(path).map_err(|error| unreadable(path, &error))?))
        };
        Ok(Self { path: path.to_owned(), input, line: 0, columns: None, are_named: false, are_places })
    }

    /// Reads the next point; `None` at the end.
    ///
    /// # Errors
    /// If the line is not that of a point.
    pub(super) fn next(&mut self) -> Result<Option<Point>, Failure> {
        let mut text = String::new();
        loop {
            text.clear();
            let mut limited = (&mut self.input).take(MAX_LINE);
            let bytes = limited.read_line(&mut text).map_err(|error| unreadable(&self.path, &error))?;
            if bytes == 0 {
                return Ok(None);
            }
            self.line += 1;
            if bytes as u64 == MAX_LINE {
                return Err(self.refused("the line is longer than 4095 bytes"));
            }
            let text = if self.line == 1 { text.trim_start_matches('\u{feff}') } else { &text };
            let fields = fields(text);
            if fields.iter().all(String::is_empty) || text.trim_start().starts_with('#') {
                continue;
            }
            if let Some(columns) = &self.columns {
                return self.point(&fields, columns).map(Some);
            }
            let (columns, are_named) = self.columns_of(&fields)?;
            self.are_named = are_named;
            let columns = self.columns.insert(columns).clone();
            if !are_named {
                return self.point(&fields, &columns).map(Some);
            }
        }
    }

    /// Columns by the first line, and whether it names them.
    fn columns_of(&self, fields: &[String]) -> Result<(Vec<usize>, bool), Failure> {
        let count = if self.are_places { 3 } else { 6 };
        let mut columns: Vec<usize> = (0..count).collect();
        if fields.iter().any(|field| field.parse::<f64>().is_ok()) {
            return Ok((columns, false));
        }
        for (column, names) in columns.iter_mut().zip(NAMES) {
            let is_it = |field: &String| names.iter().any(|name| name.eq_ignore_ascii_case(field));
            let Some(found) = fields.iter().position(is_it) else {
                let reason = format!("the line names no column {}", names[0]);
                return Err(self.refused(&reason));
            };
            *column = found;
        }
        Ok((columns, true))
    }

    fn point(&self, fields: &[String], columns: &[usize]) -> Result<Point, Failure> {
        let has_place = self.are_places && fields.len() == 3;
        if !self.are_named && fields.len() != 6 && !has_place {
            let wanted = if self.are_places {
                "a probe has three numbers, x y z"
            } else {
                "a point has six numbers, x y z nx ny nz"
            };
            return Err(self.refused(&format!("{wanted}, and the line {}", fields.len())));
        }
        let mut numbers = [0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        for (number, column) in numbers.iter_mut().zip(columns) {
            let field = fields.get(*column).map_or("", String::as_str);
            let parsed = field.parse::<f64>().ok().filter(|number| number.is_finite());
            *number = parsed.ok_or_else(|| self.refused(&format!("{field:?} is not a number")))?;
        }
        let [x, y, z, nx, ny, nz] = numbers;
        let point = Point { position: [x, y, z], normal: [nx, ny, nz] };
        match point.fault() {
            Some(fault) => Err(self.refused(fault)),
            None => Ok(point),
        }
    }

    fn refused(&self, reason: &str) -> Failure {
        let text = format!("{}, line {}: {reason}", self.path.display(), self.line);
        let help = if self.are_places {
            "write a line for each probe: x y z, in metres; or CSV with these names in its first line"
        } else {
            "write a line for each point: x y z nx ny nz, in metres; or CSV with these names in its first line"
        };
        Failure::Input(Report::new(MietteDiagnostic::new(text).with_help(help)))
    }
}

/// Fields of a line: separated by semicolons, if there is one, otherwise by commas, otherwise by blanks. In
/// quotes no character separates.
fn fields(text: &str) -> Vec<String> {
    let separator = [';', ','].into_iter().find(|separator| text.contains(*separator));
    let Some(separator) = separator else { return text.split_whitespace().map(str::to_owned).collect() };
    let (mut fields, mut is_quoted) = (vec![String::new()], false);
    for character in text.chars() {
        match character {
            '"' => is_quoted = !is_quoted,
            _ if character == separator && !is_quoted => fields.push(String::new()),
            _ => fields.last_mut().iter_mut().for_each(|field| field.push(character)),
        }
    }
    fields.iter_mut().for_each(|field| *field = field.trim().to_owned());
    fields
}

fn unreadable(path: &Path, error: &io::Error) -> Failure {
    let report = MietteDiagnostic::new(format!("cannot read the points {}: {error}", path.display()));
    let help = "check that the path names a text file and that it may be read";
    Failure::Input(Report::new(report.with_help(help)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn read(text: &str) -> Result<Vec<Point>, String> {
        read_all(text, false)
    }

    fn read_all(text: &str, are_places: bool) -> Result<Vec<Point>, String> {
        let input = Box::new(io::Cursor::new(text.to_owned().into_bytes()));
        let (columns, are_named) = (None, false);
        let mut points = Points { path: "p.csv".into(), input, line: 0, columns, are_named, are_places };
        let mut all = Vec::new();
        loop {
            match points.next() {
                Ok(Some(point)) => all.push(point),
                Ok(None) => return Ok(all),
                Err(failure) => return Err(failure.line()),
            }
        }
    }

    #[test]
    fn points_of_every_form_are_read() {
        let expected = [
            Point { position: [1.0, 2.5, -3e2], normal: [0.0, 0.0, 1.0] },
            Point { position: [4.0, 5.0, 6.0], normal: [0.0, 2.0, 0.0] },
        ];
        for text in [
            "1 2.5 -3e2 0 0 1\n4 5 6 0 2 0\n",
            "# rtrace -I\n\n  1\t2.5  -300 0 0 1  \r\n4 5 6 0 2 0",
            "1,2.5,-300,0,0,1\n4, 5, 6, 0, 2, 0\n",
            "x,y,z,nx,ny,nz\n1,2.5,-300,0,0,1\n4,5,6,0,2,0\n",
            "name;NX;NY;NZ;X;Y;Z\n\"a, b\";0;0;1;1;2.5;-300\n;0;2;0;4;5;6\n",
            "\u{feff}name,X,Y,Z,dx,dy,dz\r\n\"a, b\",1,2.5,-300,0,0,1\r\nb,4,5,6,0,2,0\r\n",
        ] {
            assert_eq!(read(text).as_deref(), Ok(&expected[..]), "{text}");
        }
        assert_eq!(read("# nothing\n\n").as_deref(), Ok(&[][..]));
    }

    #[test]
    fn probes_need_no_normals() {
        let expected = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]];
        let lines =
            ["1 2 3\n4 5 6\n", "1,2,3\n4,5,6\n", "y,x,z\n2,1,3\n5,4,6\n", "1 2 3 0 0 0\n4 5 6 1 0 x\n"];
        for text in lines {
            let points = read_all(text, true).unwrap_or_else(|error| panic!("{text}: {error}"));
            let places: Vec<_> = points.iter().map(|point| point.position).collect();
            assert_eq!(places, expected, "{text}");
        }
        for (text, parts) in [
            ("1 2 3\n1 2\n", ["line 2", "three numbers"]),
            ("x,y,nx\n1,2,3\n", ["line 1", "no column z"]),
            ("1 2 x\n", ["line 1", "\"x\""]),
        ] {
            let refusal = read_all(text, true).unwrap_err();
            assert!(parts.iter().all(|part| refusal.contains(part)), "{text:?}: {refusal}");
        }
    }

    #[test]
    fn lines_that_are_no_points_are_refused_by_number() {
        for (text, parts) in [
            ("1 2 3 0 0 1\n1 2 3\n", ["line 2", "six numbers"]),
            ("1 2 3 0 0 x\n", ["line 1", "\"x\""]),
            ("1 2 3 0 0 inf\n", ["line 1", "\"inf\""]),
            ("\n\n1 2 3 0 0 0\n", ["line 3", "normal is 0"]),
            ("0,5;0;0;0;1;0\n", ["line 1", "\"0,5\""]),
            ("0 0 0 0 1 0 lamp\n", ["line 1", "six numbers"]),
            ("1e30 0 0 0 1 0\n", ["line 1", "too far"]),
            ("x,y,z\n1,2,3\n", ["line 1", "no column nx"]),
            ("nz,x,y,z,nx,ny\n1,2,3,0,0\n", ["line 2", "\"\""]),
        ] {
            let refusal = read(text).unwrap_err();
            assert!(parts.iter().all(|part| refusal.contains(part)), "{text:?}: {refusal}");
        }
        assert!(read(&"1".repeat(5000)).unwrap_err().contains("4095"));
    }

    proptest! {
        #[test]
        fn no_text_is_read_without_an_end(text in "[-0-9eE.,;# xyzn\"\n\r\t]{0,200}") {
            let _ = read(&text);
        }
    }
}
