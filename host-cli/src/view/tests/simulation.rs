//! Tests of a simulated view with random actions of pages and cards. The view must never be stuck, must hold
//! bounded memory, and must end with the picture of the last request.

use std::time::Duration;

use photoncard_driver::layer::{Layer, Layers};
use serde_json::{Value, json};

use super::random::Random;
use super::world::World;

const ACTIONS: usize = 10_000;

/// Random message from a page, valid or not.
fn message(random: &mut Random) -> Value {
    let place = |random: &mut Random| json!([(); 3].map(|()| random.number(2.0)));
    match random.below(16) {
        0..=5 => json!({
            "type": "camera", "position": place(random), "look_at": place(random), "fov": 20 + random.below(60),
            "moving": random.below(4) > 0,
        }),
        6 => json!({"type": "set", "name": "floor.diffuse", "value": [0.5, random.number(0.4).abs(), 0.5]}),
        7 => json!({"type": "set", "name": "lamp.emission", "value": random.below(4)}),
        8 => json!({"type": "set", "name": random.one(&["flor.diffuse", "floor", "sun.colour"]), "value": 1}),
        9 => json!({
            "type": "setting", "name": random.one(&["spp", "gather_rays", "photons"]), "value": random.below(40)
        }),
        10 => json!({"type": "setting", "name": "cache", "value": random.below(2) == 0}),
        11 => json!({"type": "size", "size": [1 + random.below(90), 1 + random.below(90)]}),
        12 => json!({"type": "pick", "at": [random.below(100), random.below(100)]}),
        13 => json!({"type": "cursor", "at": [random.below(100), random.below(100)]}),
        14 => json!({"type": random.one(&["reset", "steer", "dance"])}),
        _ => json!({"type": "shown", "version": 0, "bytes": random.below(1 << 40)}),
    }
}

fn act(world: &mut World, random: &mut Random) {
    let pages: Vec<_> = world.pages.keys().copied().collect();
    match random.below(20) {
        0 if pages.len() < 5 => world.connect(),
        1 if pages.len() > 1 => world.disconnect(random.one(&pages)),
        2 => world.has_card = random.below(3) > 0,
        3 => {
            if let Some(address) = world.view.cards.next_to_try(world.now)
                && world.has_card
            {
                world.view.card_returns(&address);
            }
        }
        4 => world.now += Duration::from_millis(random.below(400)),
        5..=9 if !pages.is_empty() => {
            let page = random.one(&pages);
            world.send(page, &message(random));
        }
        10..=12 if !pages.is_empty() => {
            let page = random.one(&pages);
            for _ in 0..random.below(30) {
                world.read(page);
            }
            if random.below(2) == 0 {
                world.acknowledge(page);
            }
        }
        _ => (0..random.below(12)).for_each(|_| world.paint()),
    }
}

#[test]
fn ten_thousand_random_actions_end_in_the_picture_of_the_last_wish() {
    let mut random = Random(7);
    let mut world = World::new();
    world.connect();
    for number in 1..=ACTIONS {
        act(&mut world, &mut random);
        assert!(world.view.tiles_held() <= world.most_tiles(), "after {number} actions");
        if number % 250 == 0 {
            world.settle();
            world.check_pictures();
        }
    }
    assert!(world.firsts > 100, "{} pictures", world.firsts);
}

/// Requests arrive faster than their pictures are rendered.
#[test]
fn a_moving_camera_is_shown_and_settles_once_it_rests() {
    for is_edit in [false, true] {
        let mut world = World::new();
        world.connect();
        for number in 0..1000 {
            let x = 0.001 * f64::from(number);
            let message = if is_edit {
                json!({"type": "set", "name": "lamp.emission", "value": 1.0 + x})
            } else {
                json!({"type": "camera", "position": [x, 0.5, 3], "look_at": [0, 0, 0], "fov": 40, "moving": true})
            };
            world.send(0, &message);
            world.paint();
            while world.read(0) {}
        }
        assert!(world.firsts > 20, "{} first pictures", world.firsts);
        let seen = world.pages[&0].versions;
        assert!(seen > 20, "{seen} pictures seen");
        world.settle();
        world.check_pictures();
    }
}

/// While a page does not read, no message to it is stored; once it reads, it receives the newest picture.
#[test]
fn a_slow_page_receives_fewer_and_newer_tiles() {
    let mut world = World::new();
    world.connect();
    world.connect();
    for number in 0..200 {
        let camera = json!({"type": "camera", "position": [number, 0.5, 3], "look_at": [0, 0, 0], "fov": 40, "moving": false});
        world.send(0, &camera);
        for _ in 0..60 {
            world.paint();
            while world.read(0) {
                world.acknowledge(0);
            }
        }
    }
    world.settle();
    world.check_pictures();
    let [quick, slow] = [0, 1].map(|page| world.pages[&page].received);
    assert!(10 * slow < quick, "{slow} of {quick} bytes");
}

#[test]
fn a_reset_keeps_the_layers_that_pages_show() {
    let mut world = World::new();
    world.connect();
    for (layer, is_of_chip) in [("direct", true), ("N", false)] {
        world.send(0, &json!({"type": "layer", "name": layer}));
        world.send(0, &json!({"type": "reset"}));
        world.settle();
        assert_eq!(world.view.wish().settings.picture.layers.separate_light(), is_of_chip, "{layer}");
    }
}

#[test]
fn a_layer_that_is_rendered_is_shown_without_another_picture() {
    let mut world = World::new();
    world.connect();
    let mut wish = world.view.wish().clone();
    wish.settings.picture.layers = Layers::NONE.with([Layer::Direct]);
    world.view.wish_for(wish.clone()).unwrap();
    for (layer, is_rendered) in [("direct", true), ("indirect", false)] {
        world.send(0, &json!({"type": "layer", "name": layer}));
        world.settle();
        assert_eq!(*world.view.wish() == wish, is_rendered, "{layer}");
    }
}

/// About 4 MiB of unacknowledged tiles are sent, and no more.
#[test]
fn a_page_that_acknowledges_nothing_is_not_flooded() {
    let mut world = World::new();
    world.connect();
    world.send(0, &json!({"type": "size", "size": [1024, 1024]}));
    for _ in 0..40_000 {
        world.paint();
        while world.read(0) {}
    }
    let received = world.pages[&0].received;
    assert!((3 << 20..=5 << 20).contains(&received), "{received}");
    world.acknowledge(0);
    world.settle();
    world.check_pictures();
}

/// The limits of a remote card are known only when it refuses settings. Camera and assignments are kept.
#[test]
fn settings_that_a_card_refuses_are_replaced_by_the_last_settled_ones() {
    let mut world = World::new();
    world.connect();
    world.settle();
    let rays = world.view.wish().settings.integrator.gather_rays;
    world.max_rays = rays;
    world.send(0, &json!({"type": "set", "name": "lamp.emission", "value": 2}));
    world.send(0, &json!({"type": "setting", "name": "gather_rays", "value": rays + 1}));
    world.settle();
    world.check_pictures();
    assert_eq!(world.view.wish().settings.integrator.gather_rays, rays);
    assert_eq!(world.view.wish().assignments(), ["lamp.emission=2"]);
    let page = &world.pages[&0];
    assert_eq!((page.errors, &page.state.as_ref().unwrap()["refused"]), (1, &Value::Null));
}

#[test]
fn a_view_without_possible_settings_reports_it_until_it_has_some() {
    let mut world = World::new();
    world.connect();
    world.max_rays = 0;
    let refused = |world: &mut World| {
        (0..200).for_each(|_| world.paint());
        while world.read(0) {}
        world.pages[&0].state.as_ref().unwrap()["refused"].clone()
    };
    assert_eq!(refused(&mut world), "too many rays");
    world.send(0, &json!({"type": "set", "name": "lamp.emission", "value": 2}));
    assert_eq!(refused(&mut world), "too many rays");
    world.send(0, &json!({"type": "setting", "name": "gather_rays", "value": 0}));
    world.settle();
    world.check_pictures();
    assert_eq!(refused(&mut world), Value::Null);
}

/// Only the page that has announced a file sends its bytes, and no more than it has announced.
#[test]
fn bytes_that_no_page_has_announced_end_its_connection() {
    let mut world = World::new();
    world.connect();
    world.connect();
    assert!(!world.view.receive_bytes(0, b"map"));
    let announced = json!({"type": "drop", "name": "sky.hdr", "bytes": 5});
    world.send(0, &announced);
    assert!(!world.view.receive_bytes(1, b"123"), "another page");
    assert!(world.view.receive_bytes(0, b"123"));
    assert!(!world.view.receive_bytes(0, b"456"), "a byte too many");
    assert!(!world.view.takes_reload());
    world.send(0, &announced);
    assert!(world.view.receive_bytes(0, b"123") && world.view.receive_bytes(0, b"45"));
    assert!(world.view.takes_reload());
    // A page that leaves takes what it has sent with it.
    world.send(0, &announced);
    world.disconnect(0);
    assert!(!world.view.receive_bytes(0, b"123"));
}
