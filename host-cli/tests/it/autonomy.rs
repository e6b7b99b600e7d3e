//! Command `photoncard autonomy`.

use crate::support::Room;

/// Table of two points with these illuminances, lx.
fn table(illuminances: [f64; 2]) -> String {
    let [near, far] = illuminances;
    format!("x,y,z,nx,ny,nz,illuminance_lx,error_lx\n0.5,0,1,0,1,0,{near},1\n0.5,0,3,0,1,0,{far},\n")
}

fn room(hours: &[[f64; 2]]) -> (Room, Vec<String>) {
    let room = Room::new();
    let name = |index: usize| format!("hour{index}.csv");
    hours.iter().enumerate().for_each(|(index, hour)| room.write(&name(index), table(*hour)));
    (room, (0..hours.len()).map(name).collect())
}

#[test]
fn points_count_that_have_enough_light_in_enough_hours() {
    let (room, names) = room(&[[900.0, 299.0], [300.0, 40.0], [10.0, 500.0], [400.0, 0.0]]);
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    for (options, said, shares) in [
        (&[][..], "50.0 % of 2 points have 300 lx or more in 50 % of 4 hours", ["0.75", "0.25"]),
        (&["--share", "0.25"], "100.0 % of 2 points", ["0.75", "0.25"]),
        (&["--share", "0.75"], "50.0 % of 2 points", ["0.75", "0.25"]),
        (&["--threshold", "10", "--share", "1"], "50.0 % of 2 points", ["1", "0.75"]),
    ] {
        let outcome = room.run(&[&["autonomy", "-o", "-"], &names[..], options].concat());
        assert_eq!(outcome.status, Some(0), "{}", outcome.stderr);
        assert!(outcome.stderr.contains(said), "{}", outcome.stderr);
        let lines: Vec<&str> = outcome.stdout.lines().collect();
        assert_eq!(lines[0], "x,y,z,nx,ny,nz,autonomy");
        for (line, share) in lines[1..].iter().zip(shares) {
            assert_eq!(line.rsplit(',').next(), Some(share), "{options:?}: {line}");
        }
        room.run(&[&["autonomy", "-o", "out.csv"], &names[..], options].concat());
        assert_eq!(String::from_utf8(room.read("out.csv")).unwrap(), outcome.stdout);
    }
}

#[test]
fn tables_of_other_points_are_refused_by_line() {
    let (room, _) = room(&[[1.0, 2.0]]);
    for (text, reason) in [
        (table([1.0, 2.0]).replace("0.5,0,3", "0.5,0,4"), "line 3: its point is not the one of hour0.csv"),
        (table([1.0, 2.0]).replace("0.5,0,3,0,1,0,2,\n", ""), "has 1 point of the 2 points"),
        (table([1.0, 2.0]) + "1,1,1,0,1,0,3,1\n", "line 4: hour0.csv has only 2 points"),
        (table([1.0, 2.0]).replace("illuminance_lx", "lux"), "names no column illuminance_lx"),
        (table([1.0, f64::NAN]), "line 3: \"NaN\" is no illuminance"),
        ("x,y,z,nx,ny,nz,illuminance_lx\n1,2\n".to_owned(), "cannot read the table"),
        ("x,y,z,nx,ny,nz,illuminance_lx\n".to_owned(), "other.csv has no points"),
    ] {
        room.write("other.csv", &text);
        let outcome = room.run(&["autonomy", "hour0.csv", "other.csv", "-o", "out.csv"]);
        assert_eq!(outcome.status, Some(2), "{reason}");
        assert!(outcome.stderr.contains(reason), "{}", outcome.stderr);
        assert!(!room.path("out.csv").exists());
    }
    for options in [&["--share", "1.5"][..], &["--threshold", "-1"], &["none.csv"], &["-o", "hour0.csv"]] {
        let outcome = room.run(&[&["autonomy", "hour0.csv"], options].concat());
        assert_eq!(outcome.status, Some(2), "{options:?}: {}", outcome.stderr);
    }
}
