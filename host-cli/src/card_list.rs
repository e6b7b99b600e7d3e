//! Command `photoncard card list`.

use photoncard_driver::link::{ListedPort, list_serial_ports};
use photoncard_driver::printable::printable;
use photoncard_driver::render::CardAddress;

use crate::console::{print, say};
use crate::failure::Failure;

const COLUMNS: [&str; 4] = ["path", "USB name", "serial number", "--card"];

/// Prints a table of this machine's serial ports, one per line; nothing if there are none.
pub(crate) fn run() -> Result<(), Failure> {
    let ports = list_serial_ports().map_err(Failure::work)?;
    if ports.is_empty() {
        say(format_args!(
            "photoncard: this machine has no serial port; connect a card, or give its address by --card"
        ));
        return Ok(());
    }
    print(&table(&ports))
}

/// Lines of a table whose columns are as wide as their longest entry and two blanks apart. A dash stands for
/// a missing value.
fn table(ports: &[ListedPort]) -> Vec<String> {
    let rows: Vec<[String; 4]> =
        [COLUMNS.map(str::to_owned)].into_iter().chain(ports.iter().map(row)).collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let [path, name, number] = [0, 1, 2].map(width);
    rows.iter().map(|[a, b, c, d]| format!("{a:path$}  {b:name$}  {c:number$}  {d}")).collect()
}

fn row(port: &ListedPort) -> [String; 4] {
    let address = CardAddress::serial(&port.path).to_string();
    [&port.path, &port.usb_name, &port.serial_number, &address].map(|text| match text.as_str() {
        "" => "-".into(),
        text => printable(text).into_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_ports_survives_foreign_text() {
        let port = |path: &str, usb_name: &str, serial_number: &str| ListedPort {
            path: path.into(),
            usb_name: usb_name.into(),
            serial_number: serial_number.into(),
        };
        let ports = [
            port("/dev/ttyACM0", "Müller's 3\" card", "066BFF"),
            port("/dev/ttyS0", "", ""),
            port("/dev/ttyUSB0", "a\u{1b}[2J\nb\u{202e}", "1\t2\\"),
        ];
        let expected = r#"
path          USB name               serial number  --card
/dev/ttyACM0  Müller's 3" card       066BFF         serial:/dev/ttyACM0@115200
/dev/ttyS0    -                      -              serial:/dev/ttyS0@115200
/dev/ttyUSB0  a\u{1b}[2J\nb\u{202e}  1\t2\          serial:/dev/ttyUSB0@115200
"#;
        assert_eq!(table(&ports), expected.trim().lines().collect::<Vec<_>>());
        let addresses = ports.iter().map(|port| row(port)[3].parse());
        assert!(addresses.eq(ports.iter().map(|port| Ok(CardAddress::serial(&port.path)))));
    }
}
