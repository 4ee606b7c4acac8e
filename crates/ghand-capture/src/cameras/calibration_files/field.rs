//! A value of a calibration with its place in the file, for errors.

use std::path::Path;

use glam::{DMat3, DVec3};

use super::node::Node;
use super::rotations::from_rotation_vector;
use crate::error::CaptureError;
use crate::reading::validation::{FileValidator, member};

/// Most characters of a name in a message; names in a hostile file may have any length.
const LONGEST_NAME: usize = 60;

/// A value with its name.
#[derive(Clone)]
pub(super) struct Field<'a> {
    pub path: &'a Path,
    pub name: String,
    pub node: &'a Node,
}

impl<'a> Field<'a> {
    /// A whole file.
    pub fn root(path: &'a Path, node: &'a Node) -> Field<'a> {
        Field { path, name: String::new(), node }
    }

    pub fn invalid(&self, problem: impl Into<String>) -> CaptureError {
        let name = if self.name.is_empty() { "file" } else { &self.name };
        FileValidator { path: self.path }.invalid(name, problem)
    }

    fn member(&self, name: &str, node: &'a Node) -> Field<'a> {
        let short: String = name.chars().take(LONGEST_NAME).collect();
        Field { path: self.path, name: member(&self.name, &short), node }
    }

    /// The member of that name, unless it is empty.
    pub fn find(&self, name: &str) -> Option<Field<'a>> {
        self.node.get(name).filter(|node| **node != Node::Nothing).map(|node| self.member(name, node))
    }

    pub fn require(&self, name: &str) -> Result<Field<'a>, CaptureError> {
        self.find(name).ok_or_else(|| self.member(name, self.node).invalid("is missing; give the complete calibration"))
    }

    /// Names and members.
    pub fn entries(&self) -> impl Iterator<Item = (&'a str, Field<'a>)> {
        self.node.entries().iter().map(|(name, node)| (name.as_str(), self.member(name, node)))
    }

    /// The items of a list. Meshroom writes an empty list as an empty text.
    pub fn items(&self) -> Result<Vec<Field<'a>>, CaptureError> {
        match self.node {
            Node::List(items) => Ok(items
                .iter()
                .enumerate()
                .map(|(k, node)| Field { path: self.path, name: format!("{}[{k}]", self.name), node })
                .collect()),
            Node::Text(text) if text.is_empty() => Ok(vec![]),
            Node::Nothing => Ok(vec![]),
            other => Err(self.invalid(format!("is {}, must be a list", other.kind()))),
        }
    }

    /// The text; of a number, its digits.
    pub fn text(&self) -> Result<String, CaptureError> {
        match self.node {
            Node::Text(text) => Ok(text.clone()),
            Node::Number(number) => Ok(number.to_string()),
            other => Err(self.invalid(format!("is {}, must be a text", other.kind()))),
        }
    }

    /// Whether it says `true`, or a number other than 0.
    pub fn is_true(&self) -> bool {
        match self.node {
            Node::Number(number) => *number != 0.0,
            Node::Text(text) => {
                text.eq_ignore_ascii_case("true") || text.parse().is_ok_and(|number: f64| number != 0.0)
            }
            _ => false,
        }
    }

    /// A finite number.
    pub fn number(&self) -> Result<f64, CaptureError> {
        match self.numbers()?[..] {
            [number] => Ok(number),
            ref numbers => Err(self.invalid(format!("has {} numbers, must be one", numbers.len()))),
        }
    }

    /// A whole number from 0 on.
    pub fn whole(&self) -> Result<u32, CaptureError> {
        let number = self.number()?;
        let is_whole = number >= 0.0 && number <= f64::from(u32::MAX) && number.fract() == 0.0;
        if is_whole {
            Ok(number as u32)
        } else {
            Err(self.invalid(format!("is {number}, must be a whole number from 0 on")))
        }
    }

    /// Finite numbers: one, a list, rows, or a matrix of OpenCV with `rows`, `cols` and `data`.
    pub fn numbers(&self) -> Result<Vec<f64>, CaptureError> {
        let mut numbers = vec![];
        match self.node {
            Node::Map(_) => {
                let data = self.require("data")?;
                data.collect_numbers(data.node, &mut numbers)?;
                let size = |name: &str| self.find(name).map(|field| field.whole()).transpose();
                if let (Some(rows), Some(columns)) = (size("rows")?, size("cols")?)
                    && u64::from(rows) * u64::from(columns) != numbers.len() as u64
                {
                    let problem = format!("has {} numbers, but {rows} rows of {columns}", numbers.len());
                    return Err(data.invalid(problem));
                }
            }
            node => self.collect_numbers(node, &mut numbers)?,
        }
        Ok(numbers)
    }

    fn collect_numbers(&self, node: &Node, numbers: &mut Vec<f64>) -> Result<(), CaptureError> {
        let number = match node {
            Node::List(items) => return items.iter().try_for_each(|item| self.collect_numbers(item, numbers)),
            Node::Number(number) => *number,
            Node::Text(text) => match opencv_number(text) {
                Some(number) => number,
                None => {
                    let short: String = text.chars().take(LONGEST_NAME).collect();
                    return Err(self.invalid(format!("has {short:?}, which is not a number")));
                }
            },
            other => return Err(self.invalid(format!("has {} where a number must be", other.kind()))),
        };
        if !number.is_finite() {
            return Err(self.invalid("has a number that is not finite; repeat the calibration"));
        }
        numbers.push(number);
        Ok(())
    }

    fn array<const N: usize>(&self, what: &str) -> Result<[f64; N], CaptureError> {
        let numbers = self.numbers()?;
        <[f64; N]>::try_from(numbers.as_slice())
            .map_err(|_| self.invalid(format!("has {} numbers, must be {what}", numbers.len())))
    }

    /// Three numbers.
    pub fn vector(&self) -> Result<DVec3, CaptureError> {
        Ok(DVec3::from(self.array("3 numbers")?))
    }

    /// Width and height.
    pub fn size(&self) -> Result<[u32; 2], CaptureError> {
        let [width, height] = self.array("width and height")?;
        let whole = |number: f64| {
            let node = Node::Number(number);
            Field { path: self.path, name: self.name.clone(), node: &node }.whole()
        };
        Ok([whole(width)?, whole(height)?])
    }

    /// The matrix of three rows of three numbers.
    pub fn matrix(&self) -> Result<DMat3, CaptureError> {
        // glam takes columns; files hold rows.
        Ok(DMat3::from_cols_array(&self.array("3 rows of 3")?).transpose())
    }

    /// A rotation: 3 rows of 3, or OpenCV's rotation vector.
    pub fn rotation(&self) -> Result<DMat3, CaptureError> {
        let matrix = match self.numbers()?.len() {
            3 => from_rotation_vector(self.vector()?),
            9 => self.matrix()?,
            count => {
                let problem = format!("has {count} numbers; give a rotation matrix, 9, or OpenCV's rotation vector, 3");
                return Err(self.invalid(problem));
            }
        };
        FileValidator { path: self.path }.rotation(self.name.clone(), matrix)
    }
}

/// A number as OpenCV and others write it: also `1.`, `.Nan` and `-.Inf`.
fn opencv_number(text: &str) -> Option<f64> {
    let text = text.trim();
    let (sign, digits) = text.strip_prefix('-').map_or((1.0, text), |rest| (-1.0, rest));
    match digits.to_ascii_lowercase().as_str() {
        ".nan" => Some(f64::NAN),
        ".inf" => Some(sign * f64::INFINITY),
        _ => text.parse().ok(),
    }
}
