//! Scenes as programs write them, and every way not to be one.

use std::path::Path;

use crate::document::{Content, Document, Options, open};
use crate::materials::{Surface, Surfaces, metallic};
use observe::Silent;
use proptest::prelude::*;

fn png(path: &Path, value: [u8; 3]) {
    image::RgbImage::from_pixel(2, 2, image::Rgb(value)).save(path).unwrap();
}

fn read(folder: &Path, text: &str, material: Option<&str>) -> Result<(Surfaces, Document), String> {
    let path = folder.join("m.usda");
    std::fs::write(&path, text).unwrap();
    let options = Options { material: material.map(Into::into), ..Options::default() };
    let document = open(path.to_str().unwrap(), &options, &Silent).map_err(|error| error.to_string())?;
    let Content::Surfaces(surfaces) = &document.content else { panic!("USD gives surfaces") };
    Ok((surfaces.clone(), document))
}

fn close(a: Surface, b: Surface) {
    let values = |s: Surface| [s.diffuse[0], s.diffuse[1], s.diffuse[2], s.f0[0], s.f0[1], s.f0[2], s.alpha];
    for (x, y) in values(a).into_iter().zip(values(b)) {
        assert!((x - y).abs() < 3e-4, "{a:?} {b:?}");
    }
}

/// A material with these inputs of its surface, and a texture of colours and one of data beside it.
fn scene(inputs: &str) -> String {
    format!(
        r#"#usda 1.0
( defaultPrim = "Root"
  doc = """A scene # with a comment in a text""" )
def Xform "Root" (kind = "component") {{
    # A comment.
    double3 xformOp:translate = (0, 0, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def Scope "Looks" {{
        def Material "Gold" {{
            token outputs:surface.connect = </Root/Looks/Gold/Surface.outputs:surface>
            float inputs:rough = 0.25
            def Shader "Surface" {{
                uniform token info:id = "UsdPreviewSurface"
                {inputs}
                token outputs:surface
            }}
            def Shader "Colour" {{
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @./maps/c.png@ ( doc = "colours" )
                token inputs:sourceColorSpace = "sRGB"
                float2 inputs:st.connect = </Root/Looks/Gold/St.outputs:result>
                float3 outputs:rgb
            }}
            def Shader "Data" {{
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @maps/arm.png@
                token inputs:sourceColorSpace = "raw"
                float4 inputs:scale = (1, 0.5, 1, 1)
                float outputs:g
                float outputs:b
            }}
        }}
    }}
}}"#
    )
}

#[test]
fn numbers_and_pictures_behind_textures_are_read() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("maps")).unwrap();
    png(&folder.path().join("maps/c.png"), [200, 100, 50]);
    png(&folder.path().join("maps/arm.png"), [1, 102, 204]);
    let plain = "color3f inputs:diffuseColor = (0.5, 0.4, 0.3) float inputs:metallic = 1 float inputs:roughness = 0.3";
    let (surfaces, document) = read(folder.path(), &scene(plain), None).unwrap();
    close(surfaces.surface(0), metallic([0.5, 0.4, 0.3], [0.04; 3], 0.3, 1.0));
    assert!(document.name == "Gold" && document.size_mm.is_some(), "{:?}", document.size_mm);
    let connected = "color3f inputs:diffuseColor.connect = </Root/Looks/Gold/Colour.outputs:rgb>
        float inputs:metallic.connect = </Root/Looks/Gold/Data.outputs:b>
        float inputs:roughness.connect = [</Root/Looks/Gold/Data.outputs:g>]
        color3f inputs:emissiveColor = (1, 1, 1)";
    let (surfaces, document) = read(folder.path(), &scene(connected), Some("Gold")).unwrap();
    let srgb = |v: f32| ((v / 255.0 + 0.055) / 1.055).powf(2.4);
    // Its green channel is halved.
    close(surfaces.surface(3), metallic([srgb(200.0), srgb(100.0), srgb(50.0)], [0.04; 3], 0.2, 0.8));
    assert!(document.notes.iter().any(|note| note.contains("emissiveColor")), "{:?}", document.notes);
    // An input of the material itself.
    let through = "float inputs:metallic = 1 float inputs:roughness.connect = </Root/Looks/Gold.inputs:rough>
        color3f inputs:diffuseColor = (1, 1, 1)";
    close(
        read(folder.path(), &scene(through), None).unwrap().0.surface(0),
        metallic([1.0; 3], [0.04; 3], 0.25, 1.0),
    );
}

#[test]
fn what_is_added_to_a_texture_is_read() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("maps")).unwrap();
    png(&folder.path().join("maps/arm.png"), [1, 102, 204]);
    let text = scene("float inputs:roughness.connect = </Root/Looks/Gold/Data.outputs:g>").replace(
        "inputs:scale = (1, 0.5, 1, 1)",
        "inputs:scale = (1, 0.5, 1, 1)\nfloat4 inputs:bias = (0, 0.25, 0, 0)",
    );
    let (surfaces, _) = read(folder.path(), &text, None).unwrap();
    // 102 of 255, halved, and a quarter.
    close(surfaces.surface(0), metallic([0.18; 3], [0.04; 3], 0.45, 0.0));
}

#[test]
fn wrong_files_are_errors_with_their_line_or_field() {
    let folder = tempfile::tempdir().unwrap();
    let fails = |text: &str, says: &[&str]| {
        let error = read(folder.path(), text, None).err().unwrap();
        assert!(says.iter().all(|word| error.contains(word)), "{error}");
    };
    fails(&scene("float inputs:roughness = inf"), &["line 14", "`inf`"]);
    fails(
        &scene("float inputs:roughness.connect = </Root/Nothing.outputs:r>"),
        &["line 14", "does not exist"],
    );
    fails(&scene("float inputs:roughness.connect = </Root/Looks/Gold.outputs:surface>"), &["bake"]);
    fails(
        &scene("float inputs:roughness.connect = </Root/Looks/Gold/Surface.inputs:roughness>"),
        &["16 connections"],
    );
    fails(&scene("}"), &["expected"]);
    fails("#usda 1.0\ndef Xform \"Root\" {}", &["no material"]);
    fails("#usda 1.0\ndef Material \"M\" {", &["line 2", "`}`"]);
    fails("#usda 1.0\ndef Material \"M\" { token outputs:surface = \"x", &["line 2", "no end"]);
    fails(&scene("").replace("UsdPreviewSurface", "ND_standard"), &["ND_standard", "UsdPreviewSurface"]);
    fails(
        &scene("color3f inputs:diffuseColor.connect = </Root/Looks/Gold/Colour.outputs:rgb>")
            .replace("\"sRGB\"", "\"log\""),
        &["`log`", "srgb_texture"],
    );
    fails(
        &scene("color3f inputs:diffuseColor.connect = </Root/Looks/Gold/Colour.outputs:rgb>")
            .replace("./maps/", "../"),
        &["../c.png", "folder"],
    );
    fails(&format!("#usda 1.0\n{}", "def \"a\" {".repeat(100)), &["deep"]);
    std::fs::write(folder.path().join("b.usdc"), b"PXR-USDC\0\0").unwrap();
    let error =
        open(folder.path().join("b.usdc").to_str().unwrap(), &Options::default(), &Silent).err().unwrap();
    assert!(error.to_string().contains("export .usda"), "{error}");
}

proptest! {
    /// Whatever a file holds, reading it ends without a panic.
    #[test]
    fn hostile_files_end(cut in 0usize..1400, junk in "[(){}\\[\\]<>@\"=a-z0-9 .:,#\n-]{0,60}") {
        let whole = scene("float inputs:roughness = 0.3");
        let mut text: String = whole.chars().take(cut).collect();
        text.push_str(&junk);
        text.extend(whole.chars().skip(cut + 3));
        let _ = super::tree::parse(&text);
    }
}
