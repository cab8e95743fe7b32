use super::*;
use crate::{Colour, Layer};
use Ink::{Black, Cyan, GoldFoil, MetallicGold, SilverFoil};
use halftone::Method;
use observe::Silent;
use press::separate;
use proptest::prelude::*;
use sheet::Sheet;

fn plane(width: usize, rows: &[&str]) -> Plane {
    bitplane::from_bytes(width, rows.concat().as_bytes(), |byte| byte == b'#')
}

/// Art of these layers, in pictures of `#`.
fn art(layers: &[(Ink, &[&str])]) -> Artwork {
    let (width, length) = (layers[0].1[0].len(), layers[0].1.len());
    let mut art = Artwork::blank("test", (width, length));
    for &(ink, rows) in layers {
        let plane = plane(width, rows);
        bitplane::add(&mut art.drawn, &plane);
        let (name, shape) = (ink.name().to_owned(), Shape::Solid(plane));
        art.layers.push(Layer { ink, name, place: None, shape });
    }
    art
}

fn composed(art: &Artwork, settings: &Settings) -> Composed {
    compose(art, settings, &Library::builtin(), &Silent).unwrap()
}

/// The stacks of the dots, row by row.
fn dots(composed: &Composed) -> Vec<String> {
    composed.dots.index().iter().map(|&q| composed.dots.stacks()[usize::from(q)].to_string()).collect()
}

fn refused(art: &Artwork, settings: &Settings) -> String {
    compose(art, settings, &Library::builtin(), &Silent).unwrap_err().to_string()
}

fn with(change: impl FnOnce(&mut Settings)) -> Settings {
    let mut settings = Settings { inks: InkSet::ALL, ..Settings::default() };
    change(&mut settings);
    settings
}

#[test]
fn each_combination_of_layers_is_a_stack_in_the_order_of_the_rules() {
    let art = art(&[(Black, &["##.."]), (Ink::White, &["#.#."]), (Ink::Finish, &["###."])]);
    assert_eq!(dots(&composed(&art, &with(|_| ()))), ["W+K+F", "K+F", "W+F", "substrate"]);
}

#[test]
fn an_ink_may_lie_at_two_depths_and_several_times() {
    let art = art(&[(Ink::White, &["##."]), (Black, &[".#."]), (Ink::Finish, &["..#"])]);
    let order = Order::Inks(vec![Ink::White, Black, Ink::White, Ink::Finish]);
    let settings = with(|s| (s.order, s.passes) = (order, vec![(Ink::Finish, 2)]));
    assert_eq!(dots(&composed(&art, &settings)), ["W+W", "W+K+W", "F+F"]);
    let thrice = with(|s| s.passes = vec![(Ink::White, 3)]);
    assert_eq!(dots(&composed(&art, &thrice)), ["W+W+W", "W+W+W+K", "F"]);
}

#[test]
fn two_layers_of_an_ink_need_an_order() {
    let mut art = art(&[(Ink::White, &["#."]), (Black, &["##"]), (Ink::White, &[".#"])]);
    assert!(refused(&art, &with(|_| ())).contains("2 layers are white"));
    assert_eq!(dots(&composed(&art, &with(|s| s.order = Order::Given))), ["W+K", "K+W"]);
    for (place, layer) in [3, 2, 1].into_iter().zip(&mut art.layers) {
        layer.place = Some(place);
    }
    assert_eq!(dots(&composed(&art, &with(|_| ()))), ["K+W", "W+K"], "as numbered");
    let wrong = with(|s| s.order = Order::Inks(vec![Ink::White, Black]));
    assert!(refused(&art, &wrong).contains("white has 2 layers but is listed 1 times"));
    let wrong = with(|s| s.order = Order::Inks(vec![Ink::White, Ink::White]));
    assert!(refused(&art, &wrong).contains("black (black) is not in the list"));
}

#[test]
fn metal_on_process_ink_knocks_it_out_and_not_the_white_beneath() {
    let art = art(&[(Ink::White, &["####"]), (Black, &["###."]), (MetallicGold, &[".###"])]);
    let above = Order::Inks(vec![Ink::White, Black, MetallicGold]);
    let settings = with(|s| s.order = above.clone());
    assert_eq!(dots(&composed(&art, &settings)), ["W+K", "W+MG", "W+MG", "W+MG"]);
    let overprint = with(|s| (s.order, s.knockout) = (above, InkSet::EMPTY));
    assert_eq!(dots(&composed(&art, &overprint)), ["W+K", "W+K+MG", "W+K+MG", "W+MG"]);
    // The rules put gold beneath black: nothing is knocked out, and a suggestion warns that black hides gold.
    let below = composed(&art, &with(|_| ()));
    assert_eq!(dots(&below), ["W+K", "W+MG+K", "W+MG+K", "W+MG"]);
    let hidden = below.suggestions.iter().find(|s| s.text.contains("covers most of the metallic")).unwrap();
    let order = Remedy::Order(vec![Ink::White, Black, MetallicGold]);
    assert_eq!((hidden.dots, &hidden.remedy), (2, &order));
}

/// Glass and ghosts: what is drawn in white alone is no blank page, and a mode of white prints it.
#[test]
fn art_in_white_alone_names_the_remedy() {
    let mut art = Artwork::blank("ghost", (8, 8));
    assert!(refused(&art, &with(|_| ())).contains("ghost is white or transparent everywhere"));
    art.opaque = Some(bitplane::full(8, 8));
    assert!(refused(&art, &with(|_| ())).contains("ghost is drawn in nothing but white"));
    let composed = composed(&art, &with(|s| s.white = Some(White::Alpha)));
    assert_eq!(composed.dots.index().iter().filter(|&&dot| dot > 0).count(), 64);
}

#[test]
fn white_goes_where_its_mode_says() {
    let mut eye = art(&[
        (Black, &[".......", ".#####.", ".#...#.", ".#.#.#.", ".#...#.", ".#####.", "......."]),
        (Ink::Finish, &["#......", ".......", ".......", ".......", ".......", ".......", "......."]),
    ]);
    let white = |art: &Artwork, mode| {
        let composed = composed(art, &with(|s| s.white = Some(mode)));
        dots(&composed).iter().filter(|stack| stack.contains('W')).count()
    };
    assert_eq!(white(&eye, White::Under), 17);
    assert_eq!(white(&eye, White::Silhouette), 26);
    assert_eq!(white(&eye, White::Opaque), 18, "finish is drawn, too");
    assert!(refused(&eye, &with(|s| s.white = Some(White::Alpha))).contains("has no transparency"));
    assert!(refused(&eye, &with(|s| s.white = Some(White::Reserved))).contains("230,230,230"));
    eye.opaque = Some(bitplane::full(7, 7));
    assert_eq!(white(&eye, White::Alpha), 49);
    let none = art(&[(Ink::White, &["##"]), (Black, &[".#"])]);
    assert_eq!(dots(&composed(&none, &with(|s| s.white = Some(White::None)))), ["substrate", "K"]);
}

#[test]
fn choke_takes_white_from_every_edge_and_spread_adds_it() {
    let art = art(&[(Black, &["#######"; 7])]);
    let white = |choke: f64| {
        let composed = composed(&art, &with(|s| (s.white, s.choke) = (Some(White::Under), choke)));
        dots(&composed).iter().filter(|stack| stack.contains('W')).count()
    };
    assert_eq!([white(0.0), white(0.4), white(1.0), white(2.9), white(-3.0)], [49, 49, 25, 9, 49]);
    let far = with(|s| (s.white, s.choke) = (Some(White::Under), 300.0));
    assert!(refused(&art, &far).contains("more than 10 mm"));
    assert!(refused(&art, &with(|s| s.choke = 1.0)).contains("no white to choke"));
}

#[test]
fn choke_moves_the_outline_of_a_tint_and_not_its_dots() {
    let mut tint = Artwork::blank("test", (60, 60));
    let inside = |at: usize| (6..54).contains(&(at % 60)) && (6..54).contains(&(at / 60));
    let tones: Vec<u8> = (0..3600).map(|at| if inside(at) { 60 } else { 0 }).collect();
    let (ink, shape) = (Cyan, Shape::Tone(tones));
    tint.layers.push(Layer { ink, name: "cyan".into(), place: None, shape });
    tint.drawn = tint.layers[0].drawn(60);
    let white = |choke: f64| {
        let composed = composed(&tint, &with(|s| (s.white, s.choke) = (Some(White::Under), choke)));
        assert!(composed.report.notes.iter().all(|note| !note.contains("choke")));
        dots(&composed).iter().map(|stack| stack.contains('W')).collect::<Vec<_>>()
    };
    let plain = white(0.0);
    let count = plain.iter().filter(|white| **white).count();
    assert!((300..900).contains(&count), "{count}");
    // The nearest dot outside is less than two away on the outer two rows, and on their corners.
    let far = |at: usize| (8..52).contains(&(at % 60)) && (8..52).contains(&(at / 60));
    assert!(white(2.0).iter().enumerate().all(|(at, &white)| white == (plain[at] && far(at))));
    let spread = white(-2.0);
    assert!((0..3600).filter(|at| inside(*at)).all(|at| spread[at] == plain[at]));
    assert_eq!((0..3600).filter(|at| !inside(*at) && spread[*at]).count(), 4 * 48 * 2 + 4);
}

#[test]
fn choke_tells_of_parts_that_lose_all_their_white() {
    let rows =
        ["##########", ".#########", "..########", "..########", ".........#", "##........", "..#....###"];
    let art = art(&[(Black, &rows)]);
    let said = |choke: f64| {
        let composed = composed(&art, &with(|s| (s.white, s.choke) = (Some(White::Under), choke)));
        composed.report.notes.into_iter().filter(|note| note.contains("lose all")).collect::<Vec<_>>()
    };
    // Two parts at the bottom: one that hangs together at a corner, and one of three dots.
    assert!(said(1.0)[0].contains("0.08 mm wide lose all their white: 6 of 42 dots"), "{:?}", said(1.0));
    assert_eq!(said(0.4).len() + said(-3.0).len(), 0);
}

#[test]
fn finish_covers_the_art_or_all_of_it_or_nothing() {
    let art = art(&[(Black, &["#..."]), (Ink::Finish, &[".#.."])]);
    let finish = |mode| dots(&composed(&art, &with(|s| s.finish = Some(mode))));
    assert_eq!(finish(Finish::Artwork), ["K+F", "F", "substrate", "substrate"]);
    assert_eq!(finish(Finish::All), ["K+F", "F", "F", "F"]);
    assert_eq!(finish(Finish::None), ["K", "substrate", "substrate", "substrate"]);
}

#[test]
fn undercoats_are_suggested_and_laid_only_when_accepted() {
    let art = art(&[(SilverFoil, &["##."]), (Black, &[".##"]), (Cyan, &["..#"])]);
    let plain = composed(&art, &with(|_| ()));
    assert_eq!(dots(&plain), ["SF", "K+SF", "C+K"]);
    let foil = plain.suggestions.iter().find(|s| s.remedy == Remedy::Accept(Accept::FoilUndercoat)).unwrap();
    assert_eq!(foil.dots, 2);
    let accepted = composed(&art, &with(|s| s.accept = vec![Accept::FoilUndercoat]));
    assert_eq!(dots(&accepted), ["C+M+Y+K+SF", "C+M+Y+K+SF", "C+K"]);
    assert!(accepted.suggestions.is_empty());

    let art = self::art(&[(Black, &["##"]), (Ink::White, &["#."])]);
    let above = |s: &mut Settings| s.order = Order::Given;
    let plain = composed(&art, &with(above));
    assert!(plain.suggestions.iter().any(|s| s.remedy == Remedy::Accept(Accept::EvenWhite) && s.dots == 1));
    let accepted = composed(
        &art,
        &with(|s| {
            above(s);
            s.accept = vec![Accept::EvenWhite, Accept::WhiteThrice];
        }),
    );
    assert_eq!(dots(&accepted), ["K+P+F+P+W+W+W", "K"]);
}

#[test]
fn silver_goes_beneath_bare_white_when_it_is_accepted() {
    let art = art(&[(Ink::White, &["##."]), (Cyan, &[".##"])]);
    let plain = composed(&art, &with(|s| s.order = Order::Given));
    assert_eq!(dots(&plain), ["W", "W+C", "C"]);
    let remedy = Remedy::Accept(Accept::SilverUnderWhite);
    assert!(plain.suggestions.iter().any(|s| s.remedy == remedy && s.dots == 2), "{:?}", plain.suggestions);
    let accepted = composed(
        &art,
        &with(|s| {
            s.order = Order::Given;
            s.accept = vec![Accept::SilverUnderWhite];
        }),
    );
    assert_eq!(dots(&accepted), ["MS+W", "MS+W+C", "C"]);
    assert!(accepted.suggestions.iter().all(|s| s.remedy != remedy));
}

#[test]
fn impossible_settings_are_reported() {
    let two = art(&[(Black, &["#"]), (Cyan, &["#"])]);
    assert_eq!(dots(&composed(&two, &with(|s| s.inks = InkSet::of([Black])))), ["K"]);
    let notes = composed(&two, &with(|s| s.inks = InkSet::of([Black]))).report.notes;
    assert!(notes.iter().any(|note| note.contains("cyan: left out")), "{notes:?}");
    assert!(refused(&art(&[(Black, &["."])]), &with(|_| ())).contains("nothing to print"));
    assert!(
        refused(&art(&[(GoldFoil, &["#"])]), &Settings::default()).contains("gold-foil asks for gold-foil")
    );
    let often = with(|s| s.passes = vec![(Black, 9), (Cyan, 9)]);
    assert!(refused(&two, &often).contains("18 passes"));
}

#[test]
fn tones_become_dots_of_their_mean_and_solids_stay_solid() {
    let (width, length) = (400, 300);
    let mut art = Artwork::blank("tones", (width, length));
    let coverage = (0..width * length).map(|dot| [0, 64, 128, 255][dot % width / 100]).collect();
    art.layers.push(Layer {
        ink: Ink::White,
        name: "white".into(),
        place: None,
        shape: Shape::Tone(coverage),
    });
    let composed = composed(&art, &with(|_| ()));
    for (quarter, wanted) in [0.0, 64.0 / 255.0, 128.0 / 255.0, 1.0].into_iter().enumerate() {
        let inked = (0..width * length).filter(|dot| dot % width / 100 == quarter);
        let share = inked.filter(|&dot| composed.dots.index()[dot] > 0).count() as f64 / 30_000.0;
        assert!((share - wanted).abs() < 0.01, "quarter {quarter}: {share}, not {wanted}");
    }
}

#[test]
fn what_a_plate_has_wholly_or_not_at_all_is_exact_beside_its_tones() {
    let (width, length) = (120, 60);
    let mut art = Artwork::blank("plate", (width, length));
    // Squares of three dots, and a tone that surrounds some of them.
    let square = |x: usize, y: usize| (x / 3 * 7 + y / 3 * 5).is_multiple_of(3);
    let coverage = (0..width * length).map(|dot| match (dot % width, dot / width) {
        (x, y) if square(x, y) => 255,
        (60.., _) => 90,
        _ => 0,
    });
    let coverage: Vec<u8> = coverage.collect();
    let shape = Shape::Tone(coverage.clone());
    art.layers.push(Layer { ink: Black, name: "black".into(), place: None, shape });
    for method in [Method::Walk, Method::Cells] {
        let composed = composed(&art, &Settings { halftone: method, ..with(|_| ()) });
        for (dot, (&stack, &asked)) in composed.dots.index().iter().zip(&coverage).enumerate() {
            let wanted = [0, 255].iter().position(|&whole| whole == asked);
            assert!(wanted.is_none_or(|wanted| usize::from(stack) == wanted), "{method:?}, dot {dot}");
        }
    }
}

#[test]
fn colours_keep_off_the_dots_of_reserved_inks_and_white_paper_stays_bare() {
    let (width, length) = (96, 64);
    let mut art = Artwork::blank("picture", (width, length));
    // Left third white, the others dark red; gold on the last.
    let rgb = (0..width * length).flat_map(|dot| if dot % width < 32 { [255; 3] } else { [120, 20, 30] });
    art.colour = Colour::of_pixels::<3>(rgb.collect(), (width as u32, length as u32));
    let gold: Vec<u8> = (0..width * length).map(|dot| u8::from(dot % width >= 64)).collect();
    let shape = Shape::Solid(bitplane::from_bytes(width, &gold, |byte| byte == 1));
    art.layers.push(Layer { ink: MetallicGold, name: "gold".into(), place: None, shape });
    let stacks = dots(&composed(&art, &with(|_| ())));
    for (dot, stack) in stacks.iter().enumerate() {
        match dot % width {
            // The halftone may run a cluster over the edge, never far into the white.
            0..20 => assert_eq!(stack, "substrate", "dot {dot}"),
            64.. => assert_eq!(stack, "MG", "dot {dot}"),
            _ => {}
        }
    }
    let inked = stacks
        .iter()
        .enumerate()
        .filter(|(dot, stack)| (40..60).contains(&(dot % width)) && *stack != "substrate");
    assert!(inked.count() > 20 * length * 3 / 4);
}

/// What a dot should be, by looking at its layers one by one.
fn naive(layers: &[Layer], order: &[Ink], passes: &[(Ink, u8)], x: usize, y: usize) -> Vec<Ink> {
    let mut stack: Vec<Ink> = Vec::new();
    for &ink in order {
        let layer = layers.iter().find(|layer| layer.ink == ink).unwrap();
        let Shape::Solid(plane) = &layer.shape else { unreachable!() };
        if bitplane::at(plane, x, y) {
            if ink.kind() == Kind::Metallic {
                stack.retain(|below| below.kind() != Kind::Process);
            }
            let times = passes.iter().find(|p| p.0 == ink).map_or(1, |p| p.1);
            (0..times).for_each(|_| stack.push(ink));
        }
    }
    stack
}

proptest! {
    #![proptest_config(testing::cases(48))]
    #[test]
    fn every_dot_has_its_layers_in_order_and_the_passes_print_them(
        width in 1usize..50, length in 1usize..20, seed: u32, dense in 1u32..90,
        inks in prop::sample::subsequence(Ink::ALL.to_vec(), 1..6).prop_shuffle(), times in 1u8..3
    ) {
        let mut art = Artwork::blank("random", (width, length));
        for (at, &ink) in inks.iter().enumerate() {
            let random = |i: usize| (i as u32 ^ seed.rotate_left(at as u32)).wrapping_mul(0x9e37_79b1) >> 11;
            let bytes: Vec<u8> = (0..width * length).map(|i| u8::from(random(i) % 100 < dense)).collect();
            let mut plane = bitplane::from_bytes(width, &bytes, |byte| byte == 1);
            plane.bits[0] |= 0x80;
            art.layers.push(Layer { ink, name: ink.name().into(), place: None, shape: Shape::Solid(plane) });
        }
        let passes = vec![(inks[0], times)];
        let settings = with(|s| (s.order, s.passes) = (Order::Inks(inks.clone()), passes.clone()));
        let composed = composed(&art, &settings);
        for (dot, &q) in composed.dots.index().iter().enumerate() {
            let wanted = naive(&art.layers, &inks, &passes, dot % width, dot / width);
            prop_assert_eq!(composed.dots.stacks()[usize::from(q)].layers(), wanted, "dot {}", dot);
        }
        let paper = protocol::paper::Paper::Custom { width: width as u16, length: length as u16 };
        let sheet = Sheet::new(paper, composed.dots.stacks().to_vec(), composed.dots.index().to_vec()).unwrap();
        let separation = separate::separate(&sheet, &[], &Silent).unwrap();
        prop_assert_eq!(separate::compose(paper, &separation.passes, sheet.stacks()).unwrap(), sheet);
        let laid: u64 = composed.report.laid.iter().map(|laid| laid.dots).sum();
        let drawn: u64 = art.layers.iter().map(|layer| match &layer.shape {
            Shape::Solid(plane) => plane.dots(),
            Shape::Tone(_) => 0,
        }).sum();
        prop_assert_eq!(laid, drawn);
    }
}
