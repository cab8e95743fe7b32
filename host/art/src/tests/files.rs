//! Several files, folders, and files of several pages.

use super::plates::tiff_file;
use super::*;

/// A TIFF of grey pages of 20 x 10, each with dark rows from the top.
fn pages(rows: &[(usize, u8)]) -> Vec<u8> {
    let page = |&(rows, tone): &(usize, u8)| {
        tiff_file((20, 10), &[(0..200).map(|at| if at < 20 * rows { tone } else { 255 }).collect()], 1, &[])
    };
    let mut file = page(&rows[0]);
    for next in rows[1..].iter().map(page) {
        // The last place that leads on is that of the last directory; places in the new page move by what is before it.
        let base = file.len() as u32;
        let mut at = 4;
        loop {
            let directory = u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
            if directory == 0 {
                break;
            }
            at = directory + 2 + 12 * usize::from(u16::from_le_bytes([file[directory], file[directory + 1]]));
        }
        let mut next = next;
        let start = u32::from_le_bytes(next[4..8].try_into().unwrap()) as usize;
        for entry in 0..usize::from(u16::from_le_bytes([next[start], next[start + 1]])) {
            let entry = start + 2 + 12 * entry;
            let tag = u16::from_le_bytes([next[entry], next[entry + 1]]);
            if [273, 282, 283].contains(&tag) {
                let place = u32::from_le_bytes(next[entry + 8..entry + 12].try_into().unwrap()) + base;
                next[entry + 8..entry + 12].copy_from_slice(&place.to_le_bytes());
            }
        }
        file[at..at + 4].copy_from_slice(&(base + start as u32).to_le_bytes());
        file.extend(next);
    }
    file
}

#[test]
fn pages_of_a_tiff_are_chosen_as_those_of_a_document() {
    let bench = Bench::new();
    let file = bench.write("art.tif", pages(&[(2, 0), (5, 0), (10, 255)]));
    let error = open(std::slice::from_ref(&file), &Options::default(), &Silent).unwrap_err();
    assert!(error.to_string().contains("art on 3 pages (1, 2, 3)"), "{error}");
    let with =
        |pages: Pages| open(std::slice::from_ref(&file), &Options { pages, ..Options::default() }, &Silent);
    for (number, rows) in [(1, 2), (2, 5)] {
        let art = with(Pages::Number(number)).unwrap();
        assert_eq!(art.drawn.dots() * 10, (art.width * art.length * rows) as u64, "{number}");
    }
    assert!(with(Pages::Number(4)).unwrap_err().to_string().contains("there is no page 4; the file has 3"));
    assert!(with(Pages::Number(0)).unwrap_err().to_string().contains("there is no page 0"));
    let art = with(Pages::Inks(vec![Ink::White, Ink::MetallicGold, Ink::White])).unwrap();
    let layers: Vec<_> = art.layers.iter().map(|layer| (layer.ink, layer.place, layer.is_blank())).collect();
    assert_eq!(
        layers,
        [(Ink::White, Some(1), false), (Ink::MetallicGold, Some(2), false), (Ink::White, Some(3), true)]
    );
    assert_eq!((extent(&art.layers[0]).4, extent(&art.layers[1]).4), (40, 100));
    let text = with(Pages::Inks(vec![Ink::White])).unwrap_err().to_string();
    assert!(text.contains("it has 3 pages, but 1 inks are named"), "{text}");
    // A page that is too pale for its ink is not lost in silence.
    let pale = bench.write("pale.tif", pages(&[(2, 0), (5, 200)]));
    let options = Options { pages: Pages::Inks(vec![Ink::White, Ink::Black]), ..Options::default() };
    let text = open(&[pale], &options, &Silent).unwrap_err().to_string();
    assert!(text.contains("page 2 has art, but black gets no dot of it"), "{text}");
    // One file named after an ink is a layer, of the page that is chosen.
    let layer = bench.write("white.tif", pages(&[(2, 0), (5, 0)]));
    let error = open(std::slice::from_ref(&layer), &Options::default(), &Silent).unwrap_err();
    assert_eq!(error.hints()[0].settings[0], ("page", "1".into()), "{error}");
    let second = Options { pages: Pages::Number(2), ..Options::default() };
    assert_eq!(extent(&read(&[layer], &second).layers[0]).4, 100);
}

#[test]
fn pages_are_not_chosen_where_there_are_none() {
    let bench = Bench::new();
    let png = bench.grey("photo.png", (2, 1), &[0, 255]);
    let layers = [bench.grey("white.png", (2, 1), &[0, 255]), bench.grey("gold.png", (2, 1), &[0, 255])];
    let svg =
        bench.write("art.svg", "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1mm\" height=\"1mm\"/>");
    for pages in [Pages::Number(1), Pages::Inks(vec![Ink::White])] {
        let options = Options { pages, ..Options::default() };
        let folder = bench.0.path().to_path_buf();
        for files in [vec![png.clone()], layers.to_vec(), vec![svg.clone()], vec![folder]] {
            let text = open(&files, &options, &Silent).unwrap_err().to_string();
            assert!(text.contains("it has no pages to choose from"), "{text}");
        }
    }
}

#[test]
fn what_a_folder_holds_beside_layers_is_told() {
    let bench = Bench::new();
    bench.grey("white.png", (2, 1), &[0, 255]);
    for other in ["gold.svg", "black.TGA", "art.psd", "notes.txt", ".k.svg"] {
        bench.write(other, "x");
    }
    let art = read(&[bench.0.path().to_path_buf()], &Options::default());
    let wanted = "left out art.psd, black.TGA, gold.svg; in a folder";
    assert!(art.notes.iter().any(|note| note.contains(wanted)), "{:?}", art.notes);
    fs::remove_file(bench.path("white.png")).unwrap();
    let text = refused(&[bench.0.path().to_path_buf()]);
    assert!(text.contains("there is no picture in the folder") && text.contains("gold.svg"), "{text}");
}

#[test]
fn a_file_that_cannot_be_one_of_several_layers_says_so() {
    let bench = Bench::new();
    let white = bench.grey("white.png", (2, 1), &[0, 255]);
    let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1mm\" height=\"1mm\"/>";
    for (name, bytes, kind) in
        [("gold.svg", svg, "it is SVG"), ("gold.pdf", "%PDF-1.4", "it is PDF or PostScript")]
    {
        let text = refused(&[white.clone(), bench.write(name, bytes)]);
        assert!(text.contains(kind) && text.contains("cannot be one of several layers"), "{text}");
    }
    let text = refused(&[white, bench.write("gold.avif", b"\0\0\0\x1cftypavif\0\0\0\0")]);
    assert!(text.contains("found AVIF; save it as PNG"), "{text}");
}

#[test]
fn bmp_gif_and_webp_are_layers_and_pictures_like_png() {
    let bench = Bench::new();
    let size = (30, 20);
    let pixel = |x: u32, y: u32| image::Luma([if (x + y).is_multiple_of(3) { 0 } else { 255 }]);
    let picture = image::DynamicImage::from(image::GrayImage::from_fn(size.0, size.1, pixel)).to_rgb8();
    let options = Options { dpi: Some(600.0), ..Options::default() };
    let wanted = extent(
        &read(
            &[bench.grey("white.png", size, &picture.iter().step_by(3).copied().collect::<Vec<_>>())],
            &options,
        )
        .layers[0],
    );
    for name in ["white.bmp", "white.gif", "white.webp"] {
        let folder = bench.path(&name[6..]);
        fs::create_dir(&folder).unwrap();
        picture.save(folder.join(name)).unwrap();
        let art = read(std::slice::from_ref(&folder), &options);
        assert_eq!((art.layers.len(), extent(&art.layers[0])), (1, wanted), "{name}");
        // As a picture under another name, and cut short as an error that names the file.
        let bytes = fs::read(folder.join(name)).unwrap();
        let other = bench.write(&name.replace("white", "photo"), &bytes);
        assert_eq!(read(&[other], &options).drawn.dots(), wanted.4, "{name}");
        let cut = bench.write(&name.replace("white", "cut"), &bytes[..bytes.len() / 2]);
        assert!(refused(&[cut]).contains("cut."), "{name}");
    }
    // A BMP states pixels per metre.
    let mut bmp = fs::read(bench.path("bmp/white.bmp")).unwrap();
    bmp[38..42].copy_from_slice(&23_622u32.to_le_bytes());
    bmp[42..46].copy_from_slice(&11_811u32.to_le_bytes());
    let art = read(&[bench.write("stated.bmp", bmp)], &Options::default());
    assert_eq!((art.width, art.length), (30, 40));
}

#[test]
fn a_picture_with_nothing_on_it_is_no_layer_with_a_slip_in_its_name() {
    let bench = Bench::new();
    let options = Options { dpi: Some(600.0), ..Options::default() };
    let art = read(&[bench.grey("blank.png", (20, 10), &[255; 200])], &options);
    assert!(!art.notes.iter().any(|note| note.contains("black")), "{:?}", art.notes);
    let error =
        compose(&art, &Settings::default(), &inks::Library::builtin(), &Silent).unwrap_err().to_string();
    assert!(error.ends_with("blank is white or transparent everywhere"), "{error}");
    let art = read(&[bench.grey("blakc.png", (20, 10), &[0; 200])], &options);
    let note =
        "because its name is that of no ink; to print it as a layer of black, rename the file to black.png";
    assert!(art.notes.iter().any(|text| text.contains(note)), "{:?}", art.notes);
}
