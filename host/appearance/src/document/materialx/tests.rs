//! Documents as the sites hand them out, and every way not to follow a connection.

use std::path::Path;

use crate::document::{Content, Document, Options, open};
use crate::materials::{Materials, Surface, Surfaces, metallic};
use observe::Silent;

fn png(path: &Path, value: [u8; 3]) {
    image::RgbImage::from_pixel(2, 2, image::Rgb(value)).save(path).unwrap();
}

fn read(folder: &Path, text: &str, material: Option<&str>) -> Result<(Surfaces, Document), String> {
    let path = folder.join("m.mtlx");
    std::fs::write(&path, text).unwrap();
    let options = Options { material: material.map(Into::into), ..Options::default() };
    let document = open(path.to_str().unwrap(), &options, &Silent).map_err(|error| error.to_string())?;
    let Content::Surfaces(surfaces) = &document.content else { panic!("MaterialX gives surfaces") };
    Ok((surfaces.clone(), document))
}

fn close(a: Surface, b: Surface) {
    let values = |s: Surface| [s.diffuse[0], s.diffuse[1], s.diffuse[2], s.f0[0], s.f0[1], s.f0[2], s.alpha];
    for (x, y) in values(a).into_iter().zip(values(b)) {
        assert!((x - y).abs() < 2e-4, "{a:?} {b:?}");
    }
}

fn srgb(v: f32) -> f32 {
    ((v / 255.0 + 0.055) / 1.055).powf(2.4)
}

fn shader(kind: &str, inputs: &str, around: &str) -> String {
    format!(
        r#"<?xml version="1.0"?><materialx version="1.38" colorspace="lin_rec709">{around}
        <{kind} name="SR" type="surfaceshader">{inputs}</{kind}>
        <surfacematerial name="tin" type="material"><input name="surfaceshader" type="surfaceshader" nodename="SR"/>
        </surfacematerial></materialx>"#
    )
}

#[test]
fn pictures_behind_graphs_prefixes_and_factors_are_read() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("maps")).unwrap();
    png(&folder.path().join("maps/colour.png"), [200, 100, 50]);
    png(&folder.path().join("maps/arm.png"), [1, 128, 204]);
    let graph = r#"<nodegraph name="NG" fileprefix="maps/">
        <tiledimage name="col" type="color3"><input name="file" type="filename" value="colour.png" colorspace="srgb_texture"/>
        <input name="uvtiling" type="vector2" value="2.0, 2.0"/></tiledimage>
        <image name="arm" type="vector3"><input name="file" type="filename" value="arm.png"/></image>
        <multiply name="half" type="color3"><input name="in1" type="color3" nodename="col"/><input name="in2" type="float" value="0.5"/></multiply>
        <extract name="r" type="float"><input name="in" type="vector3" nodename="arm"/><input name="index" type="integer" value="1"/></extract>
        <separate3 name="s" type="multioutput"><input name="in" type="vector3" nodename="arm"/></separate3>
        <output name="c" type="color3" nodename="half"/><output name="rough" type="float" nodename="r"/>
        <output name="metal" type="float" nodename="s" output="outb"/></nodegraph>"#;
    let inputs = |colour: &str, roughness: &str, metal: &str| {
        format!(
            r#"<input name="{colour}" type="color3" nodegraph="NG" output="c"/>
            <input name="{roughness}" type="float" nodegraph="NG" output="rough"/>
            <input name="{metal}" type="float" nodegraph="NG" output="metal"/>
            <input name="transmission" type="float" value="0"/><input name="sheen" type="float" value="0.5"/>"#
        )
    };
    let base = [200.0, 100.0, 50.0].map(|v: f32| 0.5 * srgb(v));
    let expected = metallic(base, [0.04; 3], 128.0 / 255.0, 0.8);
    for (kind, inputs) in [
        ("standard_surface", inputs("base_color", "specular_roughness", "metalness")),
        ("open_pbr_surface", inputs("base_color", "specular_roughness", "base_metalness")),
        ("gltf_pbr", inputs("base_color", "roughness", "metallic")),
        ("UsdPreviewSurface", inputs("diffuseColor", "roughness", "metallic")),
    ] {
        let (surfaces, document) = read(folder.path(), &shader(kind, &inputs, graph), None).unwrap();
        assert_eq!((surfaces.width(), &document.name[..], document.size_mm), (2, "tin", None));
        close(surfaces.surface(3), expected);
        let said = document.notes.join("\n");
        assert!(
            said.contains("inputs that are not printed: sheen") && !said.contains("transmission"),
            "{said}"
        );
        assert!(said.contains("col: the picture is printed once"), "{said}");
    }
}

/// The defaults of the specifications, and a coat of OpenPBR's index of 1.6 as its second lobe.
#[test]
fn numbers_and_defaults_make_a_surface_and_a_coat() {
    let folder = tempfile::tempdir().unwrap();
    let standard = shader("standard_surface", r#"<input name="base" type="float" value="0.5"/>"#, "");
    let (surfaces, document) = read(folder.path(), &standard, Some("tin")).unwrap();
    close(surfaces.surface(0), metallic([0.4; 3], [0.04; 3], 0.2, 0.0));
    assert!(document.size_mm.is_some());
    let coated = shader(
        "open_pbr_surface",
        r#"<input name="base_color" type="color3" value="0.8, 0.4, 0.2"/><input name="specular_roughness" type="float" value="0.6"/>
        <input name="coat_weight" type="float" value="1"/><input name="coat_roughness" type="float" value="0.3"/>"#,
        "",
    );
    let (surfaces, _) = read(folder.path(), &coated, None).unwrap();
    let f = (0.6f32 / 2.6).powi(2);
    let base = metallic([0.8, 0.4, 0.2], [0.04; 3], 0.6, 0.0);
    let dimmed = |v: f32| v * (1.0 - f) * (1.0 - f);
    close(
        surfaces.surface(0),
        Surface { diffuse: base.diffuse.map(dimmed), f0: base.f0.map(dimmed), ..base },
    );
    let mut row = vec![0.0; surfaces.space().columns()];
    surfaces.reflectance(0, &mut row);
    let curve = surfaces.space().row(&surfaces.surface(0).curve(surfaces.space().angles()));
    let lobe = inks::ggx::lobe(surfaces.space().angles()[0], 0.09);
    assert!(
        (f64::from(row[0]) - curve[0] - f64::from(f) * lobe).abs() < 1e-3 * lobe,
        "{} {}",
        row[0],
        curve[0]
    );
}

#[test]
fn what_cannot_be_followed_is_an_error_that_says_where() {
    let folder = tempfile::tempdir().unwrap();
    png(&folder.path().join("a.png"), [9; 3]);
    let image = |file: &str| {
        format!(
            r#"<image name="i" type="color3"><input name="file" type="filename" value="{file}"/></image>"#
        )
    };
    let connected = r#"<input name="base_color" type="color3" nodename="i"/>"#;
    let standard = |around: &str| shader("standard_surface", connected, around);
    let endless =
        r#"<convert name="i" type="color3"><input name="in" type="color3" nodename="i"/></convert>"#;
    let noise = r#"<noise2d name="i" type="color3"/>"#;
    let deep = format!("<!DOCTYPE m [<!ENTITY a \"aaaa\">]>{}", shader("standard_surface", "", ""));
    for (text, says) in [
        (standard(&image("../secret.png")), "must be a file in the document's folder"),
        (standard(&image("/etc/passwd")), "must be a file in the document's folder"),
        (standard(&image("a.&lt;UDIM&gt;.png")), "several files"),
        (standard(&image("missing.png")), "missing.png"),
        (standard(endless), "no picture after 32 connections"),
        (standard(noise), "noise2d"),
        (standard(""), "`i`, to which it is connected, does not exist"),
        (shader("disney_bsdf", "", ""), "the shader disney_bsdf is not read"),
        (
            shader("standard_surface", r#"<input name="base_color" type="color3" value="red"/>"#, ""),
            "found `red`",
        ),
        ("<materialx/>".into(), "no material"),
        ("<svg/>".into(), "expected a <materialx> document"),
        ("<materialx>".into(), "XML"),
        (deep, "XML"),
    ] {
        let error = read(folder.path(), &text, None).err().unwrap();
        assert!(error.contains(says), "{text}\n{error}");
    }
    let two = standard(&image("a.png")).replace(
        "</materialx>",
        r#"<surfacematerial name="lead" type="material"><input name="surfaceshader" nodename="SR"/></surfacematerial></materialx>"#,
    );
    let error = read(folder.path(), &two, None).err().unwrap();
    assert!(error.contains("0 (tin), 1 (lead)"), "{error}");
    assert!(read(folder.path(), &two, Some("lead")).is_ok() && read(folder.path(), &two, Some("1")).is_ok());
}
