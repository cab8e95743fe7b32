//! Reading documents of materials: textures, glTF, measured BRDFs, factored files.
