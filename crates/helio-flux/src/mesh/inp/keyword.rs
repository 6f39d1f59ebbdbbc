//! Keyword lines of an input file, and the types of elements.

use super::super::shape::Shape;

/// `*NAME, PARAMETER=VALUE, …`: names in capitals without blanks, values as they stand.
#[derive(Debug, Default)]
pub(super) struct Keyword {
    pub(super) name: String,
    pub(super) parameters: Vec<(String, String)>,
}

impl Keyword {
    pub(super) fn parse(text: &str) -> Self {
        let mut parts = text.trim_start_matches('*').split(',');
        let name = squeeze(parts.next().unwrap_or(""));
        let parameters = parts
            .map(|part| {
                let (key, value) = part.split_once('=').unwrap_or((part, ""));
                (squeeze(key), value.trim().trim_matches('"').to_owned())
            })
            .filter(|(key, _)| !key.is_empty())
            .collect();
        Self { name, parameters }
    }

    pub(super) fn get(&self, key: &str) -> Option<&str> {
        let found = self.parameters.iter().find(|(name, _)| name == key);
        found.map(|(_, value)| value.as_str())
    }
}

/// Capitals, and no blanks: Abaqus sees no difference between `*End Part` and `*ENDPART`.
fn squeeze(text: &str) -> String {
    let kept = text.chars().filter(|c| !c.is_whitespace());
    kept.collect::<String>().to_uppercase()
}

/// What a type of element is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// A shape, and how many nodes stand on its lines.
    Known(Shape, usize),
    /// A beam, a spring, a flat model, …: no mirror.
    Other,
}

/// The shape of an element type of Abaqus or CalculiX, by its name.
pub(super) fn kind(name: &str) -> Kind {
    let name = name.to_uppercase();
    let solid = |nodes| match nodes {
        4 | 10 => Some(Shape::Tetrahedron),
        5 | 13 => Some(Shape::Pyramid),
        6 | 15 | 18 => Some(Shape::Wedge),
        8 | 20 | 21 | 27 => Some(Shape::Hexahedron),
        _ => None,
    };
    let shell = |nodes| match nodes {
        3 | 6 => Some(Shape::Triangle),
        4 | 8 | 9 => Some(Shape::Quadrilateral),
        _ => None,
    };
    // Longest names first: SC8R is a solid, S8R a shell; STRI65 has six nodes and five freedoms.
    let families: [(&str, bool); 13] = [
        ("DC3D", true),
        ("FC3D", true),
        ("C3D", true),
        ("F3D", true),
        ("SC", true),
        ("STRI", false),
        ("SFM3D", false),
        ("M3D", false),
        ("R3D", false),
        ("DS", false),
        ("US", false),
        ("CSS", true),
        ("S", false),
    ];
    for (prefix, is_solid) in families {
        let Some(rest) = name.strip_prefix(prefix) else {
            continue;
        };
        let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
        let nodes = match (prefix, digits.as_str()) {
            ("STRI", "65") => 6,
            (_, digits) => digits.parse().unwrap_or(0),
        };
        let shape = if is_solid { solid(nodes) } else { shell(nodes) };
        if let Some(shape) = shape {
            return Kind::Known(shape, nodes);
        }
    }
    Kind::Other
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_of_elements() {
        use Shape::{Hexahedron, Pyramid, Quadrilateral, Tetrahedron, Triangle, Wedge};
        for (name, shape, nodes) in [
            ("C3D4", Tetrahedron, 4),
            ("c3d10", Tetrahedron, 10),
            ("C3D10M", Tetrahedron, 10),
            ("C3D5", Pyramid, 5),
            ("C3D6", Wedge, 6),
            ("C3D15", Wedge, 15),
            ("C3D8I", Hexahedron, 8),
            ("C3D20R", Hexahedron, 20),
            ("SC8R", Hexahedron, 8),
            ("S3", Triangle, 3),
            ("STRI65", Triangle, 6),
            ("S4R5", Quadrilateral, 4),
            ("S8R", Quadrilateral, 8),
            ("M3D4R", Quadrilateral, 4),
        ] {
            assert_eq!(kind(name), Kind::Known(shape, nodes), "{name}");
        }
        for name in [
            "B32R", "SPRINGA", "MASS", "CPS4", "T3D2", "DCOUP3D", "S7", "S", "", "C3D",
        ] {
            assert_eq!(kind(name), Kind::Other, "{name}");
        }
    }

    #[test]
    fn keyword_lines() {
        let keyword = Keyword::parse("*Element, type = S4 , ELSET=\"My set\",,");
        assert_eq!(keyword.name, "ELEMENT");
        assert_eq!(keyword.get("TYPE"), Some("S4"));
        assert_eq!(keyword.get("ELSET"), Some("My set"));
        assert_eq!(Keyword::parse("*End Part").name, "ENDPART");
        assert_eq!(
            Keyword::parse("*NSET, NSET=A, Generate").get("GENERATE"),
            Some("")
        );
    }
}
