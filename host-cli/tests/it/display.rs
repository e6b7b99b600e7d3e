//! Picture that a display server receives during a render.

use std::io::Read;
use std::net::{SocketAddr, TcpListener};
use std::thread::{self, JoinHandle};

use crate::support::{Room, scene};
use photoncard_driver::exr::{Shown, read};

/// Picture that a viewer builds from the packets it receives.
#[derive(Default)]
pub(crate) struct Viewed {
    name: String,
    pub(crate) width: usize,
    pub(crate) height: usize,
    channels: Vec<String>,
    /// Values of each channel, row by row.
    pub(crate) values: Vec<Vec<f32>>,
    /// Number of packets with pixels.
    pub(crate) updates: usize,
}

/// Bytes of a packet that are not parsed yet.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let (bytes, rest) = self.0.split_first_chunk().unwrap();
        self.0 = rest;
        *bytes
    }

    fn byte(&mut self) -> u8 {
        self.bytes::<1>()[0]
    }

    fn number(&mut self) -> usize {
        i32::from_le_bytes(self.bytes()).try_into().unwrap()
    }

    fn long(&mut self) -> usize {
        i64::from_le_bytes(self.bytes()).try_into().unwrap()
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|&byte| byte == 0).unwrap();
        let text = String::from_utf8(self.0[..end].to_vec()).unwrap();
        self.0 = &self.0[end + 1..];
        text
    }

    fn texts(&mut self) -> Vec<String> {
        let count = self.number();
        (0..count).map(|_| self.text()).collect()
    }
}

impl Viewed {
    /// Picture of a stream of packets.
    pub(crate) fn of(mut stream: &[u8]) -> Self {
        let mut viewed = Self::default();
        while let Some((length, _)) = stream.split_first_chunk() {
            let (packet, others) = stream.split_at(u32::from_le_bytes(*length) as usize);
            viewed.take(packet);
            stream = others;
        }
        viewed
    }

    fn take(&mut self, packet: &[u8]) {
        let mut fields = Fields(packet);
        assert_eq!(fields.number(), packet.len());
        let operation = fields.byte();
        let grabs_focus = fields.byte();
        let name = fields.text();
        match operation {
            4 => {
                assert_eq!(grabs_focus, 1);
                let [width, height] = [fields.number(), fields.number()];
                let channels = fields.texts();
                let values = vec![vec![0.0; width * height]; channels.len()];
                *self = Self { name, width, height, channels, values, updates: 0 };
            }
            6 => {
                assert_eq!((grabs_focus, &name), (0, &self.name));
                self.update(&mut fields);
            }
            _ => panic!("operation {operation}"),
        }
    }

    fn update(&mut self, fields: &mut Fields) {
        let channels = fields.texts();
        let [x, y, width, height] = [(); 4].map(|()| fields.number());
        assert!(x + width <= self.width && y + height <= self.height);
        let offsets: Vec<_> = channels.iter().map(|_| fields.long()).collect();
        let strides: Vec<_> = channels.iter().map(|_| fields.long()).collect();
        let data: Vec<f32> = fields.0.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        for (index, name) in channels.iter().enumerate() {
            let channel = self.channels.iter().position(|known| known == name).unwrap();
            for pixel in 0..width * height {
                let place = (y + pixel / width) * self.width + x + pixel % width;
                self.values[channel][place] = data[offsets[index] + pixel * strides[index]];
            }
        }
        self.updates += 1;
    }
}

/// Starts a viewer for one connection. Returns its address, and the thread that returns the picture.
fn viewer() -> (SocketAddr, JoinHandle<Viewed>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let view = move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).unwrap();
        Viewed::of(&bytes)
    };
    (address, thread::spawn(view))
}

#[test]
fn a_viewer_receives_the_picture_of_the_file() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    for options in [
        &["--size=20x12", "--tile=8"] as &[_],
        &["--size=20x12", "--tile=8", "--crop=3,17,2,11", "--order=naive"],
        &["--size=20x12", "--tile=8", "--aov=all"],
    ] {
        let (address, viewing) = viewer();
        let address = address.to_string();
        let options = [&["-o", "out.exr", "--display-server", &address], options].concat();
        let outcome = room.rendered("scene.gltf", &options);
        assert!(!outcome.stderr.contains("display"), "{}", outcome.stderr);
        let viewed = viewing.join().unwrap();
        let picture = read(&room.path("out.exr"), Shown::Rendered).unwrap();
        assert_eq!(
            (viewed.name.as_str(), viewed.width, viewed.height),
            ("out.exr", picture.width, picture.height)
        );
        assert!(viewed.updates > 2);
        assert_eq!(viewed.channels.len(), if options.contains(&"--aov=all") { 24 } else { 10 });
        for (channel, name) in ["R", "G", "B"].into_iter().enumerate() {
            assert_eq!(viewed.channels[channel], name);
            let pixels: Vec<f32> = picture.pixels.iter().map(|pixel| pixel[channel]).collect();
            assert_eq!(viewed.values[channel], pixels);
            assert!(pixels.iter().any(|&value| value > 0.0));
        }
    }
}

#[test]
fn a_missing_display_is_reported_once() {
    let room = Room::new();
    room.write_scene("scene.gltf", &scene());
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let options = ["-o", "out.exr", "--quiet", "--display-server", &address];
    let outcome = room.rendered("scene.gltf", &options);
    assert_eq!(outcome.stderr.matches("display server").count(), 1, "{}", outcome.stderr);
    assert!(outcome.stderr.contains(&address));
    let outcome = room.render("scene.gltf", &["-o", "out.exr", "--display-server", "::1:7"]);
    assert_eq!(outcome.status, Some(2));
}
