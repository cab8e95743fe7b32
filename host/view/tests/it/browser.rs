//! The page in a real browser against the renderer, and every control of it.

use std::path::Path;
use std::sync::Arc;

use appearance::brdf::{Space, Table, reflectances};
use appearance::edit::{Steps, apply, fingerprint};
use appearance::factor::Factored;
use appearance::weights::{ONE, WeightMaps};
use files::shelf::{Disk, Shelf};
use image::RgbImage;
use inks::{Curve, Library, Stack};
use observe::Silent;
use press::preview::{Probe, Source, ToneCurve, picture};
use readers::Pixels;
use sheet::{Area, DotMap};
use testing::browser::Browser;
use view::page::{LONGEST, Subject, Target, page};
use view::{Camera, Light, Lit, Pose, Renderer, Scene, direction};

const SIZE: [f64; 2] = [0.12, 0.09];
const PICTURE: (usize, usize) = (600, 450);
const DOTS: (usize, usize) = (1920, 1440);
const REPLAY: &str =
    "foilpress factor 'a <b>' -o a.foil\nfoilpress edit a.foil --steps steps.toml -o edited.foil";
const NAME: &str = "<img src=x onerror=\"window.hacked=1\"></script><script>window.hacked=1</script>";

/// A document with gradients and borders of three materials, and dots of five stacks.
struct Made {
    space: Space,
    document: Factored,
    mapped: Factored,
    dots: DotMap,
    stacks: Table,
}

impl Made {
    fn new() -> Made {
        let space = Space::half_angle(32);
        let mut bases = Table::new(space.columns());
        for (diffuse, f0, alpha) in [(0.20, 0.04, 0.3), (0.01, 0.8, 0.12), (0.05, 0.3, 0.2)] {
            bases.push(&space.row(&Curve::sampled(space.angles(), |t| {
                let lobe = f0 * inks::ggx::lobe(t, alpha);
                [diffuse + lobe, 0.6 * diffuse + 0.8 * lobe, 0.2 * diffuse + 0.4 * lobe]
            })));
        }
        let (width, height) = (256, 192);
        let weights = |i: usize| {
            let (x, y) = ((i % width) as f64 / width as f64, (i / width) as f64 / height as f64);
            let inside = (x - 0.5).hypot(y - 0.5) < 0.3;
            let part = (f64::from(ONE) * (0.5 + 0.5 * (9.0 * x).sin() * (7.0 * y).cos())) as u16;
            if inside { [0, part, ONE - part] } else { [ONE - part / 2, 0, part / 2] }
        };
        let maps =
            WeightMaps::new(width, height, 3, (0..width * height).flat_map(weights).collect()).unwrap();
        let document = Factored { space: space.clone(), bases, maps };
        let names = ["substrate", "K", "MS", "MS+C", "M", "W+Y"].map(|stack| stack.parse::<Stack>().unwrap());
        let library = Library::builtin();
        let stacks = reflectances(&names, &library, &space);
        // Cells of 3 x 3 dots whose stacks change slowly over the sheet. No dot has the black stack.
        let dot = |i: usize| {
            let (x, y) = (i % DOTS.0 / 3, i / DOTS.0 / 3);
            let random = ((x as u32 * 7919 + y as u32 * 104_729).wrapping_mul(0x9e37_79b1) >> 16) % 640;
            if random < x as u32 {
                if y % 160 < 80 { 2 } else { 3 }
            } else if random.is_multiple_of(3) {
                4
            } else {
                [0, 5][(x / 80) % 2]
            }
        };
        let dots =
            DotMap::new(DOTS.0, DOTS.1, names.to_vec(), (0..DOTS.0 * DOTS.1).map(dot).collect()).unwrap();
        let mut mixtures = Table::new(space.columns());
        for pair in [[0, 2], [2, 3], [4, 5]] {
            let mixed = |c: usize| 0.5 * (stacks.row(pair[0])[c] + stacks.row(pair[1])[c]);
            mixtures.push(&(0..space.columns()).map(mixed).collect::<Vec<f64>>());
        }
        let mapped = Factored { space: space.clone(), bases: mixtures, maps: document.maps.clone() };
        Made { space, document, mapped, dots, stacks }
    }

    fn print(&self) -> Source<'_> {
        Source::Print {
            dots: &self.dots,
            space: &self.space,
            stacks: &self.stacks,
            area: Area::whole(&self.dots),
        }
    }

    fn page(&self, file: &Path, probe: &Probe) {
        let lit = Lit::new(&Source::Factored(&self.document), SIZE, 256).unwrap();
        let scene = scene(&[(-25.0, 30.0, 0.6)], (0.0, 0.0), 0.5, (0.0, 0.0), 0.0, None);
        let radiance = Renderer::new(&lit).render(&scene, 400, 300, &Silent).unwrap();
        let still = picture(&radiance, ToneCurve::PAPER).unwrap().png().unwrap();
        let mixtures: Vec<String> = (1..=3).map(|i| format!("mixture {i}")).collect();
        let subject = Subject {
            name: NAME,
            about: "a document for tests",
            size: SIZE,
            target: Some(Target {
                document: &self.document,
                mapped: &self.mapped,
                mixtures: &mixtures,
                replay: REPLAY,
            }),
            dots: &self.dots,
            stacks: &self.stacks,
            space: &self.space,
            probe,
            start: "show=document&with=printed&split=0.5&light=-25,30,0.6",
            still: &still,
        };
        let text = page(&subject, &Silent).unwrap();
        assert!(text.len() < 15_000_000);
        std::fs::write(file, text).unwrap();
    }
}

fn scene(
    lights: &[(f64, f64, f64)],
    view: (f64, f64),
    distance: f64,
    tilt: (f64, f64),
    curl: f64,
    probe: Option<&Probe>,
) -> Scene {
    let near = |d: f64| (d > 0.0).then_some(d);
    let lamp = |&(azimuth, elevation, d): &(f64, f64, f64)| {
        let towards = direction(azimuth, elevation);
        near(d).map_or(Light::Far(towards), |d| Light::Near(towards.map(|c| c * d)))
    };
    let aspect = PICTURE.0 as f64 / PICTURE.1 as f64;
    Scene {
        camera: Camera::whole(direction(view.0, view.1), near(distance), SIZE, aspect),
        pose: Pose { turn: tilt.0.to_radians(), tip: tilt.1.to_radians(), curl: near(curl) },
        lights: lights.iter().map(lamp).collect(),
        probe: probe.cloned(),
    }
}

/// How far two pictures are apart. Away from edges is where nothing within two pixels differs by a tenth.
struct Apart {
    /// Of all bytes.
    mean: f64,
    /// Away from edges.
    most: u8,
    /// Places away from edges, and those of them that differ by more than four.
    places: usize,
    over: usize,
}

impl std::fmt::Display for Apart {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Apart { mean, most, places, over } = self;
        write!(f, "mean {mean:.3}, most {most} and {over} over 4 at {places} places")
    }
}

fn decoded(picture: &Pixels<[u8; 3]>) -> RgbImage {
    image::load_from_memory(&picture.png().unwrap()).unwrap().into_rgb8()
}

fn compared(ours: &RgbImage, page: &RgbImage) -> Apart {
    assert_eq!(ours.dimensions(), page.dimensions());
    let (width, height) = ours.dimensions();
    let (mut sum, mut most, mut places, mut over) = (0.0, 0, 0, 0);
    for (x, y, p) in ours.enumerate_pixels() {
        let q = page.get_pixel(x, y);
        let off = (0..3).map(|c| p.0[c].abs_diff(q.0[c])).max().unwrap_or(0);
        sum += (0..3).map(|c| f64::from(p.0[c].abs_diff(q.0[c]))).sum::<f64>() / 3.0;
        if x < 2 || y < 2 || x + 2 >= width || y + 2 >= height {
            continue;
        }
        let near = (x - 2..=x + 2).flat_map(|i| (y - 2..=y + 2).map(move |j| (i, j)));
        if near.into_iter().all(|(i, j)| (0..3).all(|c| ours.get_pixel(i, j).0[c].abs_diff(p.0[c]) < 26)) {
            places += 1;
            most = most.max(off);
            over += usize::from(off > 4);
        }
    }
    Apart { mean: sum / f64::from(width * height), most, places, over }
}

#[test]
fn the_page_draws_what_the_renderer_draws_in_a_browser() {
    let Some(browser) = Browser::find() else { return };
    let folder = tempfile::tempdir().unwrap();
    let made = Made::new();
    let probe = Probe::studio(64);
    let file = folder.path().join("page.html");
    made.page(&file, &probe);
    let far = [(20.0, 10.0, 0.0)];
    let two = [(-35.0, 20.0, 0.4), (50.0, -10.0, 0.0)];
    type State<'a> = (&'a str, &'a [(f64, f64, f64)], (f64, f64), f64, (f64, f64), f64, bool, f64, f32);
    let whole: [State; 16] = [
        ("document", &far, (0.0, 0.0), 0.0, (0.0, 0.0), 0.0, false, 0.0, 0.4),
        ("document", &two, (0.0, 0.0), 0.5, (0.0, 0.0), 0.0, false, 0.0, 1.0),
        ("document", &two, (25.0, 15.0), 0.3, (-20.0, 10.0), 0.0, false, 1.0, 0.15),
        ("document", &far, (10.0, 0.0), 0.5, (0.0, 0.0), 0.06, false, 0.0, 0.4),
        ("document", &[], (0.0, 0.0), 0.0, (20.0, 0.0), 0.0, true, 0.0, 0.4),
        ("document", &far, (0.0, 0.0), 0.5, (10.0, 5.0), 0.08, true, -1.0, 0.4),
        ("mapped", &two, (-30.0, 0.0), 0.5, (0.0, 0.0), 0.0, false, 0.5, 0.4),
        ("mapped", &far, (0.0, 20.0), 0.0, (0.0, 25.0), 0.1, false, 0.0, 0.4),
        ("mapped", &[], (0.0, 0.0), 0.4, (-30.0, 10.0), 0.0, true, 0.0, 1.0),
        ("printed", &far, (0.0, 0.0), 0.0, (0.0, 0.0), 0.0, false, 0.0, 0.4),
        ("printed", &two, (0.0, 0.0), 0.5, (0.0, 0.0), 0.0, false, -1.5, 0.4),
        ("printed", &two, (15.0, 10.0), 0.25, (20.0, 20.0), 0.0, false, 0.0, 0.4),
        ("printed", &far, (0.0, 0.0), 0.5, (0.0, 0.0), 0.05, false, 1.0, 0.0),
        ("printed", &[], (0.0, 0.0), 0.5, (0.0, 15.0), 0.0, true, 0.0, 0.4),
        ("printed", &[(0.0, 0.0, 0.3)], (0.0, 0.0), 0.3, (0.0, 0.0), 0.07, true, -2.0, 0.4),
        ("printed", &far, (60.0, 0.0), 0.0, (15.0, 0.0), 0.0, false, 0.0, 0.4),
    ];
    // The whole sheet has 3.5 dots a pixel; here are one to two, where both draw the dots themselves.
    let nearer: [(State, f64); 7] = [
        (("printed", &far, (0.0, 0.0), 0.0, (0.0, 0.0), 0.0, false, 0.0, 0.4), 1.8),
        (("printed", &two, (0.0, 0.0), 0.5, (0.0, 0.0), 0.0, false, 0.0, 0.4), 2.3),
        (("printed", &far, (0.0, 0.0), 0.0, (0.0, 0.0), 0.0, false, 0.0, 0.4), 3.2),
        (("printed", &two, (15.0, 10.0), 0.3, (30.0, 20.0), 0.0, false, 0.0, 0.4), 2.5),
        (("printed", &far, (60.0, 0.0), 0.0, (10.0, 0.0), 0.0, false, 0.0, 0.4), 3.3),
        (("printed", &far, (0.0, 0.0), 0.5, (0.0, 0.0), 0.05, false, 0.5, 0.4), 2.4),
        (("printed", &[], (0.0, 0.0), 0.5, (0.0, 15.0), 0.0, true, 0.0, 0.4), 2.8),
    ];
    let states: Vec<(State, f64)> = whole.into_iter().map(|state| (state, 1.0)).chain(nearer).collect();
    let fragment = |&((show, lights, view, distance, tilt, curl, probe, stops, knee), zoom): &(
        State,
        f64,
    )| {
        let lights: Vec<String> = lights.iter().map(|(a, e, d)| format!("{a},{e},{d}")).collect();
        format!(
            "show={show}&light={}&probe={}&view={},{}&distance={distance}&tilt={},{}&curl={curl}&exposure={stops}&knee={knee}&zoom={zoom}&pan=0,0",
            lights.join(";"),
            u8::from(probe),
            view.0,
            view.1,
            tilt.0,
            tilt.1
        )
    };
    let mut fragments: Vec<String> = states.iter().map(fragment).collect();
    // Single dots, 30 pixels wide, from far away under a far light.
    let zoom = 30.0 * DOTS.0 as f64 / PICTURE.0 as f64 * 1.08;
    fragments.push(format!("show=printed&light=20,10,0&probe=0&view=0,0&distance=0&tilt=0,0&curl=0&exposure=0&knee=0.4&zoom={zoom}&pan=0,0"));
    // Edited documents, each in an address of its own.
    let edits = [
        ("0,1.5,c08040,1", (20.0, 10.0, 0.0), 0.5, false),
        ("1,0.6,ffffff,0.7;2,3,80ff80,1.6", (-15.0, 10.0, 0.4), 0.0, false),
        ("0,4,ffffff,3;1,2.5,ff4040,1", (5.0, 0.0, 0.5), -0.5, true),
    ];
    let edited = |&(edit, light, stops, probe): &(&str, (f64, f64, f64), f64, bool)| {
        format!(
            "edit={edit}&{}",
            fragment(&(("document", &[light], (0.0, 0.0), 0.5, (0.0, 0.0), 0.0, probe, stops, 0.4), 1.0))
        )
    };
    fragments.extend(edits.iter().map(edited));
    let list = folder.path().join("states.json");
    std::fs::write(&list, serde_json::to_string(&fragments).unwrap()).unwrap();
    let words = [&file, &list, &folder.path().to_path_buf()].map(|path| path.to_str().unwrap().to_owned());
    let (width, height) = (PICTURE.0.to_string(), PICTURE.1.to_string());
    browser.run(&["shots.mjs", &words[0], &words[1], &words[2], &width, &height], &file);
    let shot = |i: usize| image::open(folder.path().join(format!("{i}.png"))).unwrap().into_rgb8();

    let sources = [
        ("document", Source::Factored(&made.document)),
        ("mapped", Source::Factored(&made.mapped)),
        ("printed", made.print()),
    ];
    let lit: Vec<(&str, Lit)> =
        sources.iter().map(|(name, source)| (*name, Lit::new(source, SIZE, LONGEST).unwrap())).collect();
    let mut failed = Vec::new();
    for (i, &((show, lights, view, distance, tilt, curl, surrounded, stops, knee), zoom)) in
        states.iter().enumerate()
    {
        let lit = &lit.iter().find(|(name, _)| *name == show).unwrap().1;
        let mut scene = scene(lights, view, distance, tilt, curl, surrounded.then_some(&probe));
        scene.camera = scene.camera.zoomed(zoom, [0.0; 2], &scene.pose).unwrap();
        let radiance = Renderer::new(lit).render(&scene, PICTURE.0, PICTURE.1, &Silent).unwrap();
        let ours = decoded(&picture(&radiance, ToneCurve { knee, ..ToneCurve::stops(stops) }).unwrap());
        let apart = compared(&ours, &shot(i));
        println!("{}: {apart}", fragments[i]);
        // Where single dots are drawn, most is edge. A border of dots that meets one of a pixel's sixteen places falls to either
        // side of it, and is a sixteenth of its step apart.
        let (least, over) = if zoom > 1.0 { (300, apart.places / 1000) } else { (20_000, 0) };
        if apart.mean > 1.0 || apart.over > over || apart.places < least {
            failed.push(format!("{}: {apart}", fragments[i]));
            if let Some(keep) = std::env::var_os("FOILPRESS_KEEP") {
                ours.save(Path::new(&keep).join(format!("{i}-ours.png"))).unwrap();
                shot(i).save(Path::new(&keep).join(format!("{i}-page.png"))).unwrap();
            }
        }
    }

    // The steps that the page wrote, replayed by the program.
    for (i, &(edit, light, stops, surrounded)) in edits.iter().enumerate() {
        let i = states.len() + 1 + i;
        let path = folder.path().join(format!("{i}.toml"));
        let steps = Steps::read(&(Arc::new(Disk) as Arc<dyn Shelf>), &path, &made.space, &Silent).unwrap();
        steps.check(&path, &fingerprint(&made.document)).unwrap();
        let replayed = apply(&made.document, &steps.steps).unwrap().document;
        let drawn = |document: &Factored| {
            let lit = Lit::new(&Source::Factored(document), SIZE, LONGEST).unwrap();
            let scene = scene(&[light], (0.0, 0.0), 0.5, (0.0, 0.0), 0.0, surrounded.then_some(&probe));
            let radiance = Renderer::new(&lit).render(&scene, PICTURE.0, PICTURE.1, &Silent).unwrap();
            decoded(&picture(&radiance, ToneCurve::stops(stops)).unwrap())
        };
        let apart = compared(&drawn(&replayed), &shot(i));
        let change = compared(&drawn(&replayed), &drawn(&made.document)).mean;
        println!("edit {edit}: {apart}, changed by {change:.1}");
        if apart.mean > 1.0 || apart.over > 0 || change < 3.0 {
            failed.push(format!("edit {edit}: {apart}, changed by {change:.1}"));
        }
    }

    // Every dot of the picture after the states, from the curve of its stack: each pixel well inside a dot.
    let dots = shot(states.len());
    let mut seen = 0;
    for (x, y, found) in dots.enumerate_pixels() {
        let at = |p: u32, side: usize, count: usize| {
            let tall = SIZE[1] * 1.08 / zoom;
            (f64::from(p) + 0.5 - side as f64 / 2.0) * tall
                / PICTURE.1 as f64
                / (SIZE[usize::from(count == DOTS.1)] / count as f64)
                + count as f64 / 2.0
        };
        let (u, v) = (at(x, PICTURE.0, DOTS.0), at(y, PICTURE.1, DOTS.1));
        if [u, v].iter().any(|p| !(0.1..0.9).contains(&p.fract())) {
            continue;
        }
        let stack = usize::from(made.dots.index()[v as usize * DOTS.0 + u as usize]);
        let l = direction(20.0, 10.0);
        let half = 0.5 * l[2].acos();
        let f = made.space.curve(made.stacks.row(stack)).at(half);
        let pixels =
            vec![[f[0] as f32 * l[2] as f32, f[1] as f32 * l[2] as f32, f[2] as f32 * l[2] as f32, 1.0]];
        let expected =
            picture(&press::preview::Radiance { width: 1, height: 1, pixels }, ToneCurve::PAPER).unwrap();
        let off = (0..3).map(|c| found.0[c].abs_diff(expected.at(0, 0)[c])).max().unwrap();
        if off > 2 {
            failed.push(format!("dot at ({x}, {y}), stack {stack}: {found:?}, not {:?}", expected.at(0, 0)));
            break;
        }
        seen += 1;
    }
    assert!(seen > 100_000, "{seen} places");
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

#[test]
#[ignore = "real time: cargo xtask test --full"]
fn every_control_does_what_it_says_in_a_browser() {
    let Some(browser) = Browser::find() else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("page.html");
    Made::new().page(&file, &Probe::studio(32));
    browser.test("page.test.mjs", ".", &file);
}
