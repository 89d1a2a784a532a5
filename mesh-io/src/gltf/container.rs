//! The container of binary glTF: its header, its description in JSON, and its data.

use gltf_json::Root;
use gltf_json::mesh::{Primitive, Semantic};
use gltf_json::validation::{Checked, Validate};

/// The largest description, in bytes.
pub const LARGEST_DESCRIPTION: usize = 16 << 20;
/// The largest number of JSON objects and lists in a description. Each takes up to 0.5 kB of memory, however short its
/// text.
pub const MOST_PARTS: usize = 400_000;
/// The largest number of commas in a description. Each separates two values, of up to 0.1 kB of memory.
pub const MOST_COMMAS: usize = 2_000_000;
/// Length of the header, in bytes.
const HEADER: usize = 12;

/// A part of a file that cannot be used.
#[derive(Debug)]
pub struct Fault {
    /// The part, such as `accessor 3`.
    pub part: String,
    /// The reason, with a remedy if one is known.
    pub reason: String,
}

impl Fault {
    /// Creates a fault of a part.
    #[must_use]
    pub fn new(part: impl Into<String>, reason: impl Into<String>) -> Self {
        Self { part: part.into(), reason: reason.into() }
    }
}

/// A file whose description is valid in itself; accessors are not checked yet.
#[derive(Debug)]
pub struct Container<'a> {
    /// The parsed JSON description.
    pub root: Root,
    /// The embedded binary data.
    pub data: &'a [u8],
}

impl<'a> Container<'a> {
    /// Parses a file, and checks the references of its description.
    ///
    /// # Errors
    /// If the file is not a binary glTF with embedded data, or its description is malformed or too large.
    ///
    /// ```
    /// let fault = mesh_io::gltf::Container::parse(b"no glTF").unwrap_err();
    /// assert_eq!(fault.part, "the header");
    /// ```
    pub fn parse(bytes: &'a [u8]) -> Result<Self, Fault> {
        let (json, data) = chunks(bytes)?;
        check_size(json).map_err(|reason| Fault::new("the description", reason))?;
        let parsed = gltf_json::deserialize::from_slice::<Root>(json);
        let root = parsed.map_err(|error| Fault::new("the description", error.to_string()))?;
        check_positions(&root)?;
        match first_error(&root) {
            Some(fault) => Err(fault),
            None => Ok(Self { root, data }),
        }
    }
}

/// Checks that a description does not take much more memory than its text.
fn check_size(json: &[u8]) -> Result<(), String> {
    if json.len() > LARGEST_DESCRIPTION {
        return Err(format!("expected at most {} MiB, got {} bytes", LARGEST_DESCRIPTION >> 20, json.len()));
    }
    let count = |kinds: &[u8]| json.iter().filter(|byte| kinds.contains(byte)).count();
    for (kinds, most, what) in [(&b"{["[..], MOST_PARTS, "objects and lists"), (b",", MOST_COMMAS, "commas")] {
        let found = count(kinds);
        if found > most {
            return Err(format!("expected at most {most} {what}, got {found}"));
        }
    }
    Ok(())
}

/// Returns the description and the data of a file.
fn chunks(bytes: &[u8]) -> Result<(&[u8], &[u8]), Fault> {
    let header = |reason: String| Fault::new("the header", reason);
    if !bytes.starts_with(b"glTF") {
        return Err(header("expected `glTF`; export the body as one binary file (.glb)".into()));
    }
    let Some((&header_words, rest)) = bytes.split_first_chunk::<HEADER>() else {
        return Err(header(format!("expected {HEADER} bytes, got {}", bytes.len())));
    };
    let (version, length) = (word(&header_words[4..]), word(&header_words[8..]));
    if version != 2 {
        return Err(header(format!("expected version 2 of glTF, got {version}")));
    }
    if length != bytes.len() {
        return Err(header(format!("it says {length} bytes, but the file has {}; is it complete?", bytes.len())));
    }
    let (json, rest) = chunk(rest, b"JSON")?;
    if rest.is_empty() {
        return Err(Fault::new("the chunks", "no embedded data; export the body as one binary file (.glb)"));
    }
    Ok((json, chunk(rest, b"BIN\0")?.0))
}

/// Returns the contents of the first chunk, which must be of this type, and the bytes after it.
fn chunk<'a>(bytes: &'a [u8], expected: &[u8; 4]) -> Result<(&'a [u8], &'a [u8]), Fault> {
    let name = expected.escape_ascii();
    let fault = |reason: &str| Fault::new("the chunks", format!("expected `{name}`: {reason}"));
    let (head, rest) = bytes.split_first_chunk::<8>().ok_or_else(|| fault("the file ends in its head"))?;
    if head[4..] != expected[..] {
        return Err(fault("there is a chunk of another type"));
    }
    rest.split_at_checked(word(head)).ok_or_else(|| fault("it is longer than the file"))
}

/// Returns the little-endian number in the first four bytes.
fn word(bytes: &[u8]) -> usize {
    u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as usize
}

/// Checks the positions of all primitives, which the validation of `gltf_json` takes for granted.
fn check_positions(root: &Root) -> Result<(), Fault> {
    for (number, mesh) in root.meshes.iter().enumerate() {
        let positions = |primitive: &Primitive| primitive.attributes.get(&Checked::Valid(Semantic::Positions)).copied();
        if let Some(index) = mesh.primitives.iter().filter_map(positions).find(|at| at.value() >= root.accessors.len())
        {
            let reason = format!("there is no accessor {} for positions", index.value());
            return Err(Fault::new(format!("mesh {number}"), reason));
        }
    }
    Ok(())
}

/// Returns the first error that the validation of `gltf_json` finds; `None` for a valid file.
fn first_error(root: &Root) -> Option<Fault> {
    let mut first = None;
    root.validate(root, gltf_json::Path::new, &mut |path, error| {
        first.get_or_insert_with(|| Fault::new(path().to_string(), error.to_string()));
    });
    first
}
