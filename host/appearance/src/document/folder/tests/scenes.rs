//! Files that say what maps mean, beside the maps: they win over names, must agree, and what they leave out is told.

use super::*;

/// A MaterialX file of this metalness beside `m_basecolor.png` and `m_roughness.png`.
fn materialx(metal: f64) -> String {
    format!(
        r#"<?xml version="1.0"?>
<materialx version="1.38">
  <nodegraph name="maps">
    <image name="colour" type="color3"><input name="file" type="filename" value="m_basecolor.png" colorspace="srgb_texture"/></image>
    <image name="rough" type="float"><input name="file" type="filename" value="m_roughness.png"/></image>
    <output name="colour_out" type="color3" nodename="colour"/>
    <output name="rough_out" type="float" nodename="rough"/>
  </nodegraph>
  <standard_surface name="surface" type="surfaceshader">
    <input name="base_color" type="color3" nodegraph="maps" output="colour_out"/>
    <input name="specular_roughness" type="float" nodegraph="maps" output="rough_out"/>
    <input name="metalness" type="float" value="{metal}"/>
  </standard_surface>
  <surfacematerial name="m" type="material"><input name="surfaceshader" type="surfaceshader" nodename="surface"/></surfacematerial>
</materialx>"#
    )
}

/// The same as text USD.
const USD: &str = r#"#usda 1.0
def Material "m" {
    token outputs:surface.connect = </m/Surface.outputs:surface>
    def Shader "Surface" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </m/Colour.outputs:rgb>
        float inputs:roughness.connect = </m/Rough.outputs:r>
        float inputs:metallic = 1
        token outputs:surface
    }
    def Shader "Colour" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @m_basecolor.png@
        token inputs:sourceColorSpace = "sRGB"
        float3 outputs:rgb
    }
    def Shader "Rough" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @m_roughness.png@
        token inputs:sourceColorSpace = "raw"
        float outputs:r
    }
}"#;

fn maps() -> Folder {
    let colour = ImageBuffer::from_pixel(2, 2, Rgb([220u8, 180, 90]));
    let data = |value: u8| ImageBuffer::from_pixel(2, 2, Luma([value]));
    Folder::new().png("m_basecolor.png", colour).png("m_roughness.png", data(90)).png("m_ao.png", data(200))
}

/// Brass of the maps' colour and roughness.
fn is_brass(document: &Document) {
    let nearest = crate::materials::Nearest::to(document.materials().space(), &{
        let mut row = vec![0f32; document.materials().space().columns()];
        document.materials().reflectance(3, &mut row);
        row.iter().map(|&f| f64::from(f)).collect::<Vec<_>>()
    });
    let found = nearest.metallic();
    assert!(found.metallic > 0.95 && (found.base[0] - 0.716).abs() < 0.02, "{found:?}");
    assert!((nearest.alpha.sqrt() - 90.0 / 255.0).abs() < 0.01, "{nearest:?}");
}

#[test]
fn a_file_that_names_the_maps_wins_over_their_names() {
    for (name, text) in [("m.mtlx", materialx(1.0)), ("m.usda", USD.into())] {
        let document = maps().text(name, &text).open().unwrap();
        is_brass(&document);
        let told = document.notes.iter().any(|note| note.contains("does not name them: m_ao.png"));
        assert!(told && document.notes.iter().any(|note| note.contains(name)), "{:?}", document.notes);
    }
    // `material.toml` wins over both.
    let named = maps().text("m.usda", USD).text("material.toml", "metallic = 0.0").open().unwrap();
    assert!(named.notes.iter().all(|note| !note.contains("m.usda")), "{:?}", named.notes);
}

#[test]
fn two_files_must_agree() {
    let both = maps().text("m.mtlx", &materialx(1.0)).text("m.usda", USD).open().unwrap();
    is_brass(&both);
    assert!(both.notes.iter().any(|note| note == "m.usda says the same"), "{:?}", both.notes);
    let error = maps().text("m.mtlx", &materialx(0.0)).text("m.usda", USD).open().unwrap_err().to_string();
    assert!(
        error.contains("metallic 1.00") && error.contains("m.mtlx beside it says base colour 0.7"),
        "{error}"
    );
    // What cannot be compared is told.
    let one = maps().text("m.mtlx", &materialx(1.0)).text("m.usdc", "PXR-USDC\0\0\0\0").open().unwrap();
    assert!(one.notes.iter().any(|note| note.starts_with("m.usdc is not compared")), "{:?}", one.notes);
}

#[test]
fn the_text_in_usdz_is_read() {
    use std::io::Write as _;
    let folder = maps();
    let path = folder.path().join("thing.usdz");
    let mut archive = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
    let stored = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for name in ["m.usda", "m_basecolor.png", "m_roughness.png"] {
        archive.start_file(name, stored).unwrap();
        let bytes =
            if name == "m.usda" { USD.into() } else { std::fs::read(folder.path().join(name)).unwrap() };
        archive.write_all(&bytes).unwrap();
    }
    archive.finish().unwrap();
    is_brass(&open(path.to_str().unwrap(), &Options::default(), &Silent).unwrap());
}

#[test]
fn what_is_known_and_not_read_is_told_the_way_out() {
    for (name, way) in [
        ("lacquer.axf", "export its maps"),
        ("rust.sbsar", "export base colour"),
        ("car.mdl", "bake it"),
        ("chair.FBX", "as glTF"),
        ("velvet.btf", "fit maps"),
        ("m001.bin", "curve .csv"),
    ] {
        let folder = Folder::new().text(name, "x");
        let error = folder.open().unwrap_err().to_string();
        assert!(error.contains(name) && error.contains(way), "{error}");
        let file = open(folder.path().join(name).to_str().unwrap(), &Options::default(), &Silent);
        assert_eq!(file.unwrap_err().to_string(), error);
    }
    let folder = Folder::new().text("gloss.csv", "sample,gloss 60,gloss 20\n1,82,40\n");
    let error = open(folder.path().join("gloss.csv").to_str().unwrap(), &Options::default(), &Silent);
    assert!(error.as_ref().is_err_and(|error| error.to_string().contains("inks from")), "{error:?}");
}

#[test]
fn gloss_may_lie_in_the_alpha_of_normals() {
    let normals = ImageBuffer::from_pixel(2, 2, Rgba([128u8, 128, 255, 165]));
    let colour = || ImageBuffer::from_pixel(2, 2, Rgb([220u8, 180, 90]));
    let metal = ImageBuffer::from_pixel(2, 2, Luma([255u8]));
    let folder = Folder::new()
        .png("m_diff.png", colour())
        .png("m_ddna.png", normals.clone())
        .png("m_metallic.png", metal);
    is_brass(&folder.open().unwrap());
    // Without metal it is the other workflow, whose highlight is a dielectric's.
    let document = Folder::new().png("m_diff.png", colour()).png("m_ddna.png", normals).open().unwrap();
    let Content::Surfaces(surfaces) = &document.content else { panic!("maps give surfaces") };
    assert!((surfaces.surface(0).alpha - (90f32 / 255.0).powi(2)).abs() < 1e-3, "{:?}", surfaces.surface(0));
}
