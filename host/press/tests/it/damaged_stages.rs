//! The folders between the stages: what one wrote, damaged, for the next to read.

use inks::Library;
use protocol::paper::Paper;

use appearance::gamut::{self, InkMix};
use appearance::weights::{ONE, WeightMaps};
use halftone::halftone;
use observe::Silent;
use press::layout::{self, Arranged, Layout};
use press::separate;
use proptest::prelude::*;
use proptest::sample::Index;
use sheet::{DotMap, Sheet};
use testing::damage::{damages, survives};

/// A mix, its dots, their page and the page's passes.
fn folders() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let ramp = (0..24u16).flat_map(|pixel| [1365 * pixel, ONE - 1365 * pixel]).collect();
    let maps = WeightMaps::new(6, 4, 2, ramp).unwrap();
    let stacks = ["substrate", "MS+C", "Y"].map(|s| s.parse().unwrap()).to_vec();
    let mix = InkMix::new(stacks, maps, vec![vec![0, ONE, 0], vec![ONE / 2, 0, ONE / 2]]).unwrap();
    let paper = Paper::Custom { width: 40, length: 30 };
    let dots = halftone(&mix, (20, 16), None, &halftone::Settings::uniform(3, 4), &Silent).unwrap();
    let page = layout::arrange(&dots, &Layout::centred(paper), &Silent).unwrap();
    let passes = separate::separate(&page.sheet, Library::builtin().rules(), &Silent).unwrap();
    for name in ["mix", "dots", "sheet", "passes"] {
        std::fs::create_dir(folder.path().join(name)).unwrap();
    }
    gamut::files::save(&mix, &gamut::files::Provenance::default(), &folder.path().join("mix")).unwrap();
    dots.save(&folder.path().join("dots")).unwrap();
    page.save(&folder.path().join("sheet")).unwrap();
    separate::files::save(&passes, (600, 600), &folder.path().join("passes")).unwrap();
    folder
}

#[test]
fn damaged_mixes_sheets_and_passes_are_answered() {
    let folders = folders();
    let path = |name: &str| folders.path().join(name);
    proptest!(testing::cases(500), |(which in any::<Index>(), damages in damages())| {
        survives(&path("mix"), which, &damages, gamut::files::load);
        survives(&path("dots"), which, &damages, DotMap::load);
        survives(&path("sheet"), which, &damages, Sheet::load);
        let census = |folder: &_| Arranged::load(folder).map(|page| page.laid.census(&page.sheet));
        survives(&path("sheet"), which, &damages, census);
        survives(&path("passes"), which, &damages, separate::files::load);
    });
}
