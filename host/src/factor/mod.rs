//! A document's materials as a few bases and their weight maps.
