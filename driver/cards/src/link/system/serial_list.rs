//! Lists the serial ports of this machine.

use std::io;

use serialport::SerialPortType;

use super::LinkError;

/// Serial port of this machine.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ListedPort {
    /// Path of the port; its name on Windows.
    pub path: String,
    /// Manufacturer and product as a USB device reports them, arbitrary text; empty for other ports.
    pub usb_name: String,
    /// Serial number as a USB device reports it, arbitrary text; empty if there is none.
    pub serial_number: String,
}

/// Lists the serial ports of this machine by path, without pseudo terminals.
///
/// # Errors
/// If the system does not list them.
pub fn list_serial_ports() -> Result<Vec<ListedPort>, LinkError> {
    let mut ports = available().map_err(|error| LinkError::list(&error))?;
    ports.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(ports)
}

fn available() -> io::Result<Vec<ListedPort>> {
    // `serialport` panics without /sys, which a container may lack.
    if cfg!(target_os = "linux") {
        std::fs::read_dir("/sys/class/tty")?;
    }
    Ok(serialport::available_ports()?.into_iter().map(listed).collect())
}

fn listed(port: serialport::SerialPortInfo) -> ListedPort {
    let path = port.port_name;
    match port.port_type {
        SerialPortType::UsbPort(usb) => {
            let names = [usb.manufacturer, usb.product].map(Option::unwrap_or_default);
            ListedPort {
                path,
                usb_name: names.join(" ").trim().to_owned(),
                serial_number: usb.serial_number.unwrap_or_default(),
            }
        }
        _ => ListedPort { path, ..ListedPort::default() },
    }
}

#[cfg(test)]
mod tests {
    use serialport::{SerialPortInfo, UsbPortInfo};

    use super::*;

    #[test]
    fn a_port_has_the_names_that_its_device_reports() {
        let usb = |manufacturer: Option<&str>, product: Option<&str>, serial_number: Option<&str>| {
            let [manufacturer, product, serial_number] =
                [manufacturer, product, serial_number].map(|text| text.map(str::to_owned));
            let info = UsbPortInfo { vid: 1, pid: 2, serial_number, manufacturer, product };
            listed(SerialPortInfo { port_name: "p".into(), port_type: SerialPortType::UsbPort(info) })
        };
        let port = |usb_name: &str, serial_number: &str| ListedPort {
            path: "p".into(),
            usb_name: usb_name.into(),
            serial_number: serial_number.into(),
        };
        assert_eq!(usb(Some("ST"), Some("STLINK-V3"), Some("06")), port("ST STLINK-V3", "06"));
        assert_eq!(usb(None, Some("STLINK-V3"), None), port("STLINK-V3", ""));
        assert_eq!(usb(Some("ST"), None, None), port("ST", ""));
        let other = SerialPortInfo { port_name: "p".into(), port_type: SerialPortType::Unknown };
        assert_eq!(listed(other), port("", ""));
    }
}
