use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::thread;
use std::time::Duration;

use photoncard_picture::film::{Film, FilmPixel, PixelValue, SumFormat, Window};
use photoncard_picture::layer::Layers;
use photoncard_picture::sink::TileSink;
use photoncard_picture::viewer::Viewer;
use photoncard_shared::message::Tile;
use rustix::net::sockopt;

use super::packet::create_image;
use super::*;

/// Film of `tiles` tiles of 64 x 64 pixels in a column, cropped from a larger picture.
fn film(tiles: u32) -> (Film, Vec<Tile>) {
    let window = Window { x0: 3, x1: 67, y0: 5, y1: 5 + 64 * tiles };
    let mut film = Film::new(100, 100 + 64 * tiles, window, SumFormat::ONE).unwrap();
    for (x, y) in (window.y0..window.y1).flat_map(|y| (3..67).map(move |x| (x, y))) {
        let pixel = PixelValue { radiance: [x as f32, y as f32, 0.5], ..Default::default() };
        let sums = SumFormat::ONE.sums(&FilmPixel { pixel, ..FilmPixel::default() });
        film.write(x, y, &sums).unwrap();
    }
    let tile = |id| Tile { id, x: 3, y: 5 + 64 * id, width: 64, height: 64 };
    (film, (0..tiles).map(tile).collect())
}

fn settings(listener: &TcpListener) -> DisplaySettings {
    let address = listener.local_addr().unwrap().to_string().parse().unwrap();
    DisplaySettings { address, image: "film".into() }
}

/// Packets that arrive on a connection until it ends.
fn packets(mut stream: TcpStream) -> Vec<Vec<u8>> {
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    let mut packets = Vec::new();
    while let Some((length, _)) = bytes.split_first_chunk() {
        let rest = bytes.split_off(u32::from_le_bytes(*length) as usize);
        packets.push(std::mem::replace(&mut bytes, rest));
    }
    packets
}

fn failure(display: &Display) -> Option<DisplayError> {
    display.failure().map(|error| *error.downcast().expect("an error of a display"))
}

/// Shows all tiles of a picture, and finishes it.
fn show(display: &Display, film: &Film, tiles: &[Tile]) {
    tiles.iter().for_each(|tile| display.put(&film.finished(tile).unwrap()));
    display.finish(film);
}

#[test]
fn every_tile_is_shown_although_few_fit_into_the_queue() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let settings = settings(&listener);
    let (film, tiles) = film(9);
    let viewer = thread::spawn(move || {
        // All tiles wait before the first is taken.
        thread::sleep(Duration::from_millis(200));
        packets(listener.accept().unwrap().0)
    });
    let display = Display::with_room_for(100_000, &settings, film.window(), Layers::colour());
    show(&display, &film, &tiles);
    assert!(display.failure().is_none());
    let mut expected: Vec<Vec<u8>> =
        tiles.iter().map(|tile| display.packet(&film.finished(tile).unwrap())).collect();
    drop(display);
    let mut shown = viewer.join().unwrap();
    assert!(shown.remove(0) == create_image("film", [64, 576], &["R", "G", "B"]));
    // Delayed tiles come last; their number depends on the sender's speed.
    shown.sort_unstable();
    expected.sort_unstable();
    assert!(shown == expected, "{} packets of {}", shown.len(), expected.len());
}

#[test]
fn a_display_that_never_reads_is_given_up_and_reported_once() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    sockopt::set_socket_recv_buffer_size(&listener, 4096).unwrap();
    let (film, tiles) = film(400);
    let display = Display::open(&settings(&listener), film.window(), Layers::colour());
    show(&display, &film, &tiles);
    assert!(matches!(failure(&display), Some(DisplayError::Slow { packets, .. }) if packets > 0));
    show(&display, &film, &tiles);
    assert!(display.failure().is_none());
}

#[test]
fn a_display_that_disconnects_is_reported_once() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let settings = settings(&listener);
    let (film, tiles) = film(400);
    let viewer = thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        stream.read_exact(&mut [0; 100]).unwrap();
    });
    let display = Display::open(&settings, film.window(), Layers::colour());
    show(&display, &film, &tiles);
    viewer.join().unwrap();
    assert!(matches!(failure(&display), Some(DisplayError::Gone { .. })));
    assert!(display.failure().is_none());
}

#[test]
fn a_display_that_cannot_be_reached_is_reported_once() {
    let settings = settings(&TcpListener::bind("127.0.0.1:0").unwrap());
    let (film, tiles) = film(1);
    let display = Display::open(&settings, film.window(), Layers::colour());
    show(&display, &film, &tiles);
    let said = failure(&display).unwrap().to_string();
    assert!(said.contains(&settings.address.to_string()) && said.contains("outputs.display"), "{said}");
    assert!(display.failure().is_none());
}
