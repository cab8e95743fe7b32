//! `foilpress edit` as users of the program meet it.

use std::fs;
use std::path::Path;

use testing::program::{Bench, entries, text};

fn bytes(folder: &Path) -> Vec<(String, Vec<u8>)> {
    entries(folder).into_iter().map(|name| (name.clone(), fs::read(folder.join(name)).unwrap())).collect()
}

/// A texture folder with three materials side by side: varnish of this colour, silver, and brass.
fn textures(bench: &Bench, name: &str, varnish: [u8; 3]) {
    fs::create_dir(bench.path(name)).unwrap();
    let bands =
        |bands: [[u8; 3]; 3]| image::RgbImage::from_fn(24, 16, |x, _| image::Rgb(bands[x as usize / 8]));
    for (file, picture) in [
        ("base_color.png", bands([varnish, [230, 230, 235], [220, 180, 90]])),
        ("roughness.png", bands([[90; 3], [110; 3], [140; 3]])),
        ("metallic.png", bands([[0; 3], [255; 3], [255; 3]])),
    ] {
        picture.save(bench.path(name).join(file)).unwrap();
    }
}

/// A factored document of three bases.
fn tile(bench: &Bench) {
    textures(bench, "tile", [180, 30, 25]);
    bench.done("factor tile -q --bases 3 -o tile.foil");
}

/// Edits of edits keep all steps, which replay on the first document to the same bytes; the documents before stay as they
/// are.
#[test]
fn steps_of_several_commands_replay_to_the_same_files() {
    let bench = Bench::new();
    tile(&bench);
    let original = bytes(&bench.path("tile.foil"));
    let (width, height) = image::image_dimensions(bench.path("tile.foil/weights-00.png")).unwrap();
    let mask = image::GrayImage::from_fn(width, height, |x, _| image::Luma([(x * 255 / width) as u8]));
    mask.save(bench.path("fade.png")).unwrap();
    bench.done("edit tile.foil -q --basis 0 --rougher 1.5 --tint #c08040 --mask fade.png -o one.foil");
    bench.done("edit one.foil -q --replace 1=one.foil:2 --mask fade.png -o two.foil");
    let first = bytes(&bench.path("two.foil"));
    let said = bench.done("edit two.foil -q --mix 0,1,0.25 -o three.foil");
    assert!(said.contains("3 steps in three.foil/steps.toml"), "{said}");
    assert_eq!(bytes(&bench.path("two.foil")), first);
    bench.done("edit tile.foil -q --steps three.foil/steps.toml -o replayed.foil");
    assert_eq!(bytes(&bench.path("replayed.foil")), bytes(&bench.path("three.foil")));
    assert_eq!(bytes(&bench.path("tile.foil")), original);

    // Changed by hand, the document begins anew.
    let curves = fs::read_to_string(bench.path("one.foil/bases.csv")).unwrap();
    let (curves, last) = curves.trim_end().rsplit_once('\n').unwrap();
    let angle: Vec<&str> = last.split(',').take(2).collect();
    fs::write(bench.path("one.foil/bases.csv"), format!("{curves}\n{},0.5,0.5,0.5\n", angle.join(",")))
        .unwrap();
    let output = bench.run("edit one.foil -q --swap 0,1 -o fresh.foil");
    let said = text(&output.stderr);
    assert!(output.status.success() && said.contains("so they are not kept"), "{said}");
    assert!(text(&output.stdout).contains("1 step in"));

    // An edited document is a document, and is replaced as one.
    bench.done("edit tile.foil -q --swap 0,1 -o two.foil");
    bench.done("map two.foil -q -o two.mix");
}

#[test]
fn showing_writes_nothing_and_says_what_leaves_the_gamut() {
    let bench = Bench::new();
    tile(&bench);
    let before = bench.entries();
    let said = bench.done("edit tile.foil -q --show");
    assert!(
        said.contains("d of print") && said.lines().filter(|line| line.contains(" %  #")).count() == 3,
        "{said}"
    );
    let output = bench.run("edit tile.foil -q --show --replace 0=mirror.csv");
    assert!(!output.status.success());
    // A mirror of pure green, which no ink is.
    let mirror: String =
        (0..90).map(|n| format!("{n},0,{},0\n", 500.0 * (-f64::from(n) / 2.0).exp())).collect();
    fs::write(bench.path("mirror.csv"), format!("theta_h_deg,r,g,b\n{mirror}")).unwrap();
    let output = bench.run("edit tile.foil -q --show --replace 0=mirror.csv");
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert!(err.contains("basis 0") && err.contains("what the inks can print"), "{err}");
    assert!(out.contains("step 1: basis 0 replaced by mirror.csv") && out.contains("before (dots)"), "{out}");
    fs::remove_file(bench.path("mirror.csv")).unwrap();
    assert_eq!(bench.entries(), before);
}

#[test]
fn what_cannot_be_edited_is_refused_and_leaves_nothing() {
    let bench = Bench::new();
    tile(&bench);
    image::GrayImage::new(3, 3).save(bench.path("small.png")).unwrap();
    textures(&bench, "dark", [20, 20, 20]);
    bench.done("edit tile.foil -q --swap 0,1 -o swapped.foil");
    let before = bench.entries();
    for (code, args, says) in [
        (1, "tile.foil -o out.foil", "name an edit"),
        (
            1,
            "tile.foil --basis 9 --rougher 2 -o out.foil",
            "there is no basis 9: the document has bases 0 to 2",
        ),
        (1, "tile.foil --rougher NaN -o out.foil", "rougher = NaN: expected 0.05 to 20"),
        (1, "tile.foil --albedo inf -o out.foil", "albedo = inf"),
        (1, "tile.foil --glossier 0 -o out.foil", "glossier = 0"),
        (1, "tile.foil --mix 0,1,NaN -o out.foil", "share = NaN"),
        (1, "tile.foil --rougher 2 --mask small.png -o out.foil", "small.png has 3 x 3 pixels"),
        (1, "tile.foil --rougher 2 --mask basis:7 -o out.foil", "there is no basis 7"),
        (1, "tile.foil --rougher 2 --mask nowhere.png -o out.foil", "nowhere.png"),
        (1, "tile.foil --replace 0=tile -o out.foil", "a material for every pixel"),
        (1, "tile.foil --replace 0=tile.foil -o out.foil", "name one of them"),
        (1, "dark --steps swapped.foil/steps.toml -o out.foil", "these steps are for the document `tile`"),
        (1, "tile.foil --swap 0,1 -o tile.foil", "is the document itself"),
        (1, "tile.foil --swap 0,1 -o tile", "which this command did not write"),
        (2, "tile.foil --swap 0 -o out.foil", "such as 1,4"),
        (2, "tile.foil --swap 0,1 --rougher 2 -o out.foil", "cannot be used with"),
        (2, "tile.foil --steps a.toml --rougher 2 -o out.foil", "cannot be used with"),
        (2, "tile.foil --tint brown -o out.foil", "a colour such as #c08040"),
    ] {
        let said = bench.refused(code, &format!("edit -q {args}"));
        assert!(said.contains(says), "{args}: {said}");
        assert_eq!(bench.entries(), before, "{args}");
    }
}
