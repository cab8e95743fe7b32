//! The role of a texture file from its name, by the conventions of texture sites and painting programs.
//!
//! Problem: `Metal053C_1K-JPG_NormalGL.jpg`, `rusty_metal_02_arm_2k.png`, `T_Rock_BC.tga`, `albedo.jpg`.
//! Method: the stem is split into lower-case words at punctuation and where a capital follows a lower-case
//! letter. Words that most files of the folder begin with are the name of the material and are skipped (so
//! `rusty_metal_diff` is not a metallic map, whatever else lies in the folder), and so is a word that most
//! end with: the name of the workflow. Words about size and format are dropped. The longest run of the
//! remaining words that names a role, furthest to the right, decides. Single letters count only as the last
//! word, as in Unreal's suffixes.
//! Limits: a file whose name follows no convention is not used; `material.toml` can name the files instead.

/// The role of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Base colour, albedo or diffuse colour.
    BaseColor,
    /// Roughness.
    Roughness,
    /// Metallic, metalness.
    Metallic,
    /// Occlusion, roughness and metallic in red, green and blue.
    Packed,
    /// Specular colour (f0) or level.
    Specular,
    /// Glossiness, one minus roughness.
    Glossiness,
    /// Metallic in red and smoothness (glossiness) in alpha, as Unity has them.
    MetallicSmoothness,
    /// Specular colour, and smoothness (glossiness) in alpha, as Unity has them.
    SpecularSmoothness,
    /// How much of the surface a clear coat covers.
    Coat,
    /// Roughness of the clear coat.
    CoatRoughness,
    /// Surface normals, of either handedness.
    Normal,
    /// A part of the appearance that ink on paper cannot show: sheen, light from within, transmission and
    /// the like.
    Unprintable,
    /// A map that is known not to describe reflectance: occlusion, height, a preview and the like.
    Ignored,
}

impl Role {
    /// Its name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Role::BaseColor => "base colour",
            Role::Roughness => "roughness",
            Role::Metallic => "metallic",
            Role::Packed => "occlusion-roughness-metallic",
            Role::Specular => "specular",
            Role::Glossiness => "glossiness",
            Role::MetallicSmoothness => "metallic-smoothness",
            Role::SpecularSmoothness => "specular-smoothness",
            Role::Coat => "clear coat",
            Role::CoatRoughness => "clear coat's roughness",
            Role::Normal => "normal",
            Role::Unprintable | Role::Ignored => "other",
        }
    }
}

/// Words, joined, that name a role.
const ALIASES: [(&str, Role); 100] = [
    ("basecolor", Role::BaseColor),
    ("basecolour", Role::BaseColor),
    ("base", Role::BaseColor),
    ("albedo", Role::BaseColor),
    ("albedotransparency", Role::BaseColor),
    ("alb", Role::BaseColor),
    ("diffuse", Role::BaseColor),
    ("diffusecolor", Role::BaseColor),
    ("diff", Role::BaseColor),
    ("dif", Role::BaseColor),
    ("color", Role::BaseColor),
    ("colour", Role::BaseColor),
    ("col", Role::BaseColor),
    ("bc", Role::BaseColor),
    ("roughness", Role::Roughness),
    ("rough", Role::Roughness),
    ("rgh", Role::Roughness),
    ("metallic", Role::Metallic),
    ("metalness", Role::Metallic),
    ("metallness", Role::Metallic),
    ("metal", Role::Metallic),
    ("metallicity", Role::Metallic),
    ("met", Role::Metallic),
    ("mtl", Role::Metallic),
    ("orm", Role::Packed),
    ("arm", Role::Packed),
    ("aorm", Role::Packed),
    ("aormt", Role::Packed),
    ("mr", Role::Packed),
    ("rma", Role::Packed),
    ("mra", Role::Packed),
    ("mrao", Role::Packed),
    ("mro", Role::Packed),
    ("rom", Role::Packed),
    ("ram", Role::Packed),
    ("hrm", Role::Packed),
    ("ordp", Role::Packed),
    ("metallicroughness", Role::Packed),
    ("metalnessroughness", Role::Packed),
    ("metalrough", Role::Packed),
    ("metalroughness", Role::Packed),
    ("roughnessmetallic", Role::Packed),
    ("roughnessmetalness", Role::Packed),
    ("roughmetal", Role::Packed),
    ("occlusionroughnessmetallic", Role::Packed),
    ("occlusionroughnessmetalness", Role::Packed),
    ("aoroughnessmetallic", Role::Packed),
    ("aoroughnessmetalness", Role::Packed),
    ("ambientocclusionroughnessmetallic", Role::Packed),
    ("specular", Role::Specular),
    ("specularcolor", Role::Specular),
    ("specularlevel", Role::Specular),
    ("spec", Role::Specular),
    ("spc", Role::Specular),
    ("refl", Role::Specular),
    ("reflection", Role::Specular),
    ("glossiness", Role::Glossiness),
    ("gloss", Role::Glossiness),
    ("glossy", Role::Glossiness),
    ("smoothness", Role::Glossiness),
    ("metallicsmoothness", Role::MetallicSmoothness),
    ("metalnesssmoothness", Role::MetallicSmoothness),
    ("specularsmoothness", Role::SpecularSmoothness),
    ("clearcoat", Role::Coat),
    ("coat", Role::Coat),
    ("clearcoatweight", Role::Coat),
    ("coatweight", Role::Coat),
    ("clearcoatroughness", Role::CoatRoughness),
    ("coatroughness", Role::CoatRoughness),
    ("clearcoatnormal", Role::Ignored),
    ("coatnormal", Role::Ignored),
    ("normal", Role::Normal),
    ("normals", Role::Normal),
    ("normalmap", Role::Normal),
    ("normalgl", Role::Normal),
    ("normaldx", Role::Normal),
    ("norm", Role::Normal),
    ("nor", Role::Normal),
    ("nrm", Role::Normal),
    ("nrml", Role::Normal),
    ("ddn", Role::Normal),
    ("ddna", Role::Normal),
    ("ao", Role::Ignored),
    ("occlusion", Role::Ignored),
    ("ambientocclusion", Role::Ignored),
    ("occ", Role::Ignored),
    ("cavity", Role::Ignored),
    ("height", Role::Ignored),
    ("heightmap", Role::Ignored),
    ("displacement", Role::Ignored),
    ("displace", Role::Ignored),
    ("disp", Role::Ignored),
    ("bump", Role::Ignored),
    ("opacity", Role::Unprintable),
    ("alpha", Role::Unprintable),
    ("mask", Role::Ignored),
    ("curvature", Role::Ignored),
    ("preview", Role::Ignored),
    ("thumbnail", Role::Ignored),
    ("thumb", Role::Ignored),
];

/// Words for parts of the appearance that ink cannot show. What follows one belongs to it: `sheen_color` is
/// no base colour.
const UNPRINTABLE: [&str; 16] = [
    "sheen",
    "fuzz",
    "emissive",
    "emission",
    "emit",
    "anisotropy",
    "anisotropic",
    "translucency",
    "subsurface",
    "sss",
    "scattering",
    "transmission",
    "iridescence",
    "thinfilm",
    "thickness",
    "diffusetransmission",
];

const LETTERS: [(&str, Role); 8] = [
    ("b", Role::BaseColor),
    ("d", Role::BaseColor),
    ("r", Role::Roughness),
    ("m", Role::Metallic),
    ("s", Role::Specular),
    ("g", Role::Glossiness),
    ("n", Role::Normal),
    ("h", Role::Ignored),
];

/// Channels of roughness and of metallic in packed maps whose letters say another order than occlusion,
/// roughness, metallic.
const PACKINGS: [(&str, usize, Option<usize>); 8] = [
    ("rma", 0, Some(1)),
    ("mra", 1, Some(0)),
    ("mrao", 1, Some(0)),
    ("mro", 1, Some(0)),
    ("rom", 0, Some(2)),
    ("ram", 0, Some(2)),
    ("hrm", 1, Some(2)),
    // Occlusion, roughness, displacement.
    ("ordp", 1, None),
];

/// The channels of roughness and of metallic in the packed map of this name.
pub fn packing(name: &str) -> (usize, Option<usize>) {
    let words = joined(&words(stem(name)));
    let found = words.iter().rev().find_map(|word| PACKINGS.iter().find(|(letters, ..)| letters == word));
    found.map_or((1, Some(2)), |&(_, roughness, metallic)| (roughness, metallic))
}

/// Whether the name of a normal map says that its alpha is glossiness.
pub fn has_gloss(name: &str) -> bool {
    words(stem(name)).iter().any(|word| word == "ddna")
}

/// Words, with those that an inner capital has divided put together again: `ORDp` is one.
fn joined(words: &[String]) -> Vec<String> {
    let pairs = words.windows(2).map(|pair| pair.concat());
    words.iter().cloned().chain(pairs).collect()
}

/// The words of a stem, lower case.
fn words(stem: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut small = false;
    for c in stem.chars() {
        if !c.is_alphanumeric() {
            words.push(String::new());
            small = false;
            continue;
        }
        if c.is_uppercase() && small {
            words.push(String::new());
        }
        small = c.is_lowercase();
        if let Some(word) = words.last_mut() {
            word.extend(c.to_lowercase());
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

/// Whether a word is about size, format or handedness.
fn is_noise(word: &str) -> bool {
    const NOISE: [&str; 19] = [
        "jpg", "jpeg", "png", "tif", "tiff", "exr", "hdr", "gl", "ogl", "opengl", "dx", "directx", "8bit",
        "16bit", "32bit", "srgb", "linear", "raw", "map",
    ];
    let number = word.trim_end_matches('k');
    let digits = |s: &str| !s.is_empty() && s.chars().all(|c| c.is_ascii_digit());
    NOISE.contains(&word)
        || digits(number)
        || word.strip_prefix("lod").is_some_and(digits)
        || word.strip_prefix('v').is_some_and(digits)
}

/// The role that some words name: furthest right, then longest.
fn role(words: &[String]) -> Option<Role> {
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    // Metallic, occlusion, a mask of details and smoothness: the one name in which `map` says something.
    let mask_map = words.windows(2).any(|two| two == ["mask", "map"]);
    let words: Vec<&str> = words.into_iter().filter(|word| !is_noise(word)).collect();
    if mask_map {
        return Some(Role::MetallicSmoothness);
    }
    let last = *words.last()?;
    if let Some(&(_, role)) = LETTERS.iter().find(|(letter, _)| *letter == last) {
        return Some(role);
    }
    for end in (1..=words.len()).rev() {
        for start in end.saturating_sub(4)..end {
            let run = words[start..end].concat();
            let other = |word: &str| UNPRINTABLE.contains(&word);
            if other(&run) || start.checked_sub(1).is_some_and(|before| other(words[before])) {
                return Some(Role::Unprintable);
            }
            if let Some(&(_, role)) = ALIASES.iter().find(|(alias, _)| *alias == run) {
                return Some(role);
            }
        }
    }
    None
}

/// A file's name without its ending.
pub fn stem(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

/// Whether a file is a picture that is read, by its name.
pub fn is_picture(name: &str) -> bool {
    has_extension(name, &["png", "jpg", "jpeg", "tif", "tiff", "exr", "hdr", "rgbe", "tga", "webp", "bmp"])
}

/// Whether a name has one of these endings.
pub fn has_extension(name: &str, kinds: &[&str]) -> bool {
    name.rsplit_once('.').is_some_and(|(_, kind)| kinds.iter().any(|known| kind.eq_ignore_ascii_case(known)))
}

/// The role that the last word of a file's name tells by itself.
pub fn alone(name: &str) -> Option<Role> {
    let words = words(stem(name));
    let last = words.iter().rfind(|word| !is_noise(word))?;
    role(std::slice::from_ref(last))
}

/// The words that more than half of the files begin with, as many as leave one of them its role.
fn beginning(all: &[Vec<String>]) -> &[String] {
    let is_shared = |start: &&[String]| {
        let rests: Vec<&[String]> = all.iter().filter_map(|words| words.strip_prefix(*start)).collect();
        rests.len() > 1 && 2 * rests.len() > all.len() && rests.iter().any(|rest| role(rest).is_some())
    };
    let starts = all.iter().flat_map(|words| (1..words.len()).map(|count| &words[..count]));
    starts.filter(is_shared).max_by_key(|start| start.len()).unwrap_or_default()
}

/// The word that more than half of the files end with, if each of these has a role without it: the name of
/// a workflow, such as that of `_COL_METALNESS` and `_ROUGHNESS_METALNESS`.
fn ending(all: &[Vec<String>]) -> Option<String> {
    /// Source: two may end alike by chance, such as `coat_roughness` and `sheen_roughness`.
    const FEW: usize = 3;
    let last = |words: &[String]| words.iter().rposition(|word| !is_noise(word));
    let shared = |word: &String| {
        let ends = all.iter().filter(|words| last(words).is_some_and(|at| words[at] == *word));
        let rests: Vec<Option<Role>> = ends.map(|words| role(&words[..last(words).unwrap_or(0)])).collect();
        rests.len() >= FEW && 2 * rests.len() > all.len() && rests.iter().all(Option::is_some)
    };
    all.iter().filter_map(|words| last(words).map(|at| &words[at])).find(|word| shared(word)).cloned()
}

/// The role of each file of a folder, by its stem; `None` if the name tells nothing.
pub fn roles(stems: &[&str]) -> Vec<Option<Role>> {
    let mut all: Vec<Vec<String>> = stems.iter().map(|stem| words(stem)).collect();
    if let Some(workflow) = ending(&all) {
        for words in &mut all {
            let last = words.iter().rposition(|word| !is_noise(word));
            if last.is_some_and(|at| words[at] == workflow) {
                words.truncate(last.unwrap_or(0));
            }
        }
    }
    let start = beginning(&all);
    all.iter()
        .map(|words| {
            let shared = words.iter().zip(start).take_while(|(own, shared)| own == shared).count();
            role(&words[shared..])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(stems: &[&str]) -> Vec<Option<Role>> {
        roles(stems)
    }

    #[test]
    #[expect(clippy::type_complexity, reason = "a table that is easy to read")]
    fn the_names_of_each_site_are_recognised() {
        use Role::*;
        let sites: [(&str, &[(&str, Option<Role>)]); 13] = [
            (
                "Fab",
                &[
                    ("T_tdbkabgs_2K_B", Some(BaseColor)),
                    ("T_tdbkabgs_2K_N", Some(Normal)),
                    ("T_tdbkabgs_2K_ORM", Some(Packed)),
                ],
            ),
            (
                "other orders",
                &[
                    ("T_Thing_RMA", Some(Packed)),
                    ("thing_hrm_2k", Some(Packed)),
                    ("Thing_ORDp", Some(Packed)),
                    ("T_Thing_BC", Some(BaseColor)),
                ],
            ),
            (
                "Poliigon",
                &[
                    ("Thing_COL_2K_METALNESS", Some(BaseColor)),
                    ("Thing_ROUGHNESS_2K_METALNESS", Some(Roughness)),
                    ("Thing_METALNESS_2K_METALNESS", Some(Metallic)),
                    ("Thing_NRM_2K_METALNESS", Some(Normal)),
                ],
            ),
            (
                "Unity",
                &[
                    ("Thing_AlbedoTransparency", Some(BaseColor)),
                    ("Thing_MetallicSmoothness", Some(MetallicSmoothness)),
                    ("Thing_SpecularSmoothness", Some(SpecularSmoothness)),
                    ("Thing_MaskMap", Some(MetallicSmoothness)),
                    ("Thing_mask", Some(Ignored)),
                    ("Thing_Emission", Some(Unprintable)),
                ],
            ),
            (
                "layers of a material",
                &[
                    ("x_base_color", Some(BaseColor)),
                    ("x_sheen_color", Some(Unprintable)),
                    ("x_SheenRoughness", Some(Unprintable)),
                    ("x_emissive_color", Some(Unprintable)),
                    ("x_clearcoat", Some(Coat)),
                    ("x_ClearCoatRoughness", Some(CoatRoughness)),
                    ("x_coat_normal", Some(Ignored)),
                    ("x_roughness", Some(Roughness)),
                ],
            ),
            (
                "ambientCG",
                &[
                    ("Metal053C", None),
                    ("Metal053C_1K-JPG_Color", Some(BaseColor)),
                    ("Metal053C_1K-JPG_NormalGL", Some(Normal)),
                    ("Metal053C_1K-JPG_NormalDX", Some(Normal)),
                    ("Metal053C_1K-JPG_Roughness", Some(Roughness)),
                    ("Metal053C_1K-JPG_Metalness", Some(Metallic)),
                    ("Metal053C_1K-JPG_Displacement", Some(Ignored)),
                ],
            ),
            (
                "Poly Haven",
                &[
                    ("rusty_metal_02_diff_2k", Some(BaseColor)),
                    ("rusty_metal_02_arm_2k", Some(Packed)),
                    ("rusty_metal_02_nor_gl_2k", Some(Normal)),
                    ("rusty_metal_02_rough_2k", Some(Roughness)),
                    ("rusty_metal_02_metal_2k", Some(Metallic)),
                    ("rusty_metal_02_spec_2k", Some(Specular)),
                    ("rusty_metal_02_disp_2k", Some(Ignored)),
                ],
            ),
            (
                "Substance",
                &[
                    ("mat_Base_Color", Some(BaseColor)),
                    ("mat_OcclusionRoughnessMetallic", Some(Packed)),
                    ("mat_Normal_OpenGL", Some(Normal)),
                    ("mat_Glossiness", Some(Glossiness)),
                    ("mat_Specular", Some(Specular)),
                ],
            ),
            (
                "Unreal",
                &[
                    ("T_Rock_BC", Some(BaseColor)),
                    ("T_Rock_N", Some(Normal)),
                    ("T_Rock_ORM", Some(Packed)),
                    ("T_Rock_R", Some(Roughness)),
                    ("T_Rock_M", Some(Metallic)),
                    ("T_Rock_H", Some(Ignored)),
                ],
            ),
            (
                "three.js",
                &[
                    ("hardwood2_diffuse", Some(BaseColor)),
                    ("hardwood2_roughness", Some(Roughness)),
                    ("hardwood2_bump", Some(Ignored)),
                ],
            ),
            (
                "glTF",
                &[
                    ("Default_albedo", Some(BaseColor)),
                    ("Default_metalRoughness", Some(Packed)),
                    ("Default_AO", Some(Ignored)),
                ],
            ),
            (
                "Megascans",
                &[
                    ("xyz_2K_Albedo", Some(BaseColor)),
                    ("xyz_2K_Normal_LOD0", Some(Normal)),
                    ("xyz_2K_Gloss", Some(Glossiness)),
                    ("xyz_2K_AO", Some(Ignored)),
                ],
            ),
            (
                "plain",
                &[
                    ("albedo", Some(BaseColor)),
                    ("METALLIC", Some(Metallic)),
                    ("occlusion_roughness_metallic", Some(Packed)),
                    ("normal-ogl", Some(Normal)),
                    ("holiday", None),
                ],
            ),
        ];
        for (site, files) in sites {
            let stems: Vec<&str> = files.iter().map(|(stem, _)| *stem).collect();
            for (found, (stem, expected)) in all(&stems).into_iter().zip(files) {
                assert_eq!(found, *expected, "{site}: {stem}");
            }
        }
    }

    #[test]
    fn the_name_of_the_material_is_not_a_role() {
        assert_eq!(all(&["rusty_metal", "rusty_metal_color"]), [None, Some(Role::BaseColor)]);
        assert_eq!(all(&["gloss_paint_diffuse", "gloss_paint_roughness"])[0], Some(Role::BaseColor));
        let stranger = ["rusty_metal_02_diff_1k", "rusty_metal_02_rough_1k", "render"];
        assert_eq!(all(&stranger), [Some(Role::BaseColor), Some(Role::Roughness), None]);
        // Two variants of one map have no name of a material.
        let variants = ["base_color", "base_color_2", "roughness"];
        assert_eq!(all(&variants), [Some(Role::BaseColor), Some(Role::BaseColor), Some(Role::Roughness)]);
        let named = variants.map(|name| format!("old_metal_{name}"));
        assert_eq!(all(&named.each_ref().map(String::as_str)), all(&variants));
    }
}
