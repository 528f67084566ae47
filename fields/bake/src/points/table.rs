//! Tables of points: text with one row a line.

use antumbra::LocalOrigin;

use crate::{Label, Sensors};

/// Why a text is no table of points, or no weather file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {reason}")]
pub struct BadTable {
    /// Line of the text, from 1.
    pub line: usize,
    /// What is wrong with the line.
    pub reason: String,
}

/// Names of columns.
const COLUMNS: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

impl Sensors {
    /// Sensors of a table: columns x, y, z and perhaps nx, ny, nz, by the names in the first line or else in this order.
    /// Semicolons, tabs, commas or spaces separate columns: the first of these that the first line has. Quotation marks keep
    /// a separator in a field. Every line has as many columns as the first. Empty lines and those that begin with `#` are
    /// left out. Points are in world coordinates. They are measured from `local` before they are rounded.
    ///
    /// ```
    /// # use antumbra::LocalOrigin;
    /// # use antumbra_bake::Sensors;
    /// let table = "name;x;y;z\nroof;1.5;2;3\n";
    /// let sensors = Sensors::from_table(table, &LocalOrigin::default())?;
    /// assert_eq!(sensors.points, [[1.5, 2.0, 3.0]]);
    /// # Ok::<(), antumbra_bake::BadTable>(())
    /// ```
    ///
    /// A column of names, `name` or `id`, is kept as the label `name`. One of the columns x, y and z may be missing if the first line names the other
    /// two: it is NaN then, and [`Sensors::drape`] finds heights.
    ///
    /// # Errors
    /// [`BadTable`] names the first line that is not as it should be: a number is missing, is none, is not finite or has a
    /// decimal comma; a column is there twice; a line has more or fewer columns than the first.
    pub fn from_table(text: &str, local: &LocalOrigin) -> Result<Self, BadTable> {
        let (mut sensors, points) = Self::and_points_of_table(text)?;
        sensors.points = points.iter().map(|&point| local.local(point)).collect();
        Ok(sensors)
    }

    /// Sensors of a table without their points, and the points in double precision: see [`Sensors::from_table`].
    ///
    /// # Errors
    /// As [`Sensors::from_table`].
    pub fn and_points_of_table(text: &str) -> Result<(Self, Vec<[f64; 3]>), BadTable> {
        let text = text.trim_start_matches('\u{feff}');
        let lines = (1..).zip(text.lines().map(str::trim));
        let mut lines = lines
            .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
            .peekable();
        let none = |line| bad(line, "found no points".into());
        let &(first, head) = lines.peek().ok_or_else(|| none(1))?;
        let mark = [';', '\t', ',']
            .into_iter()
            .find(|&mark| head.contains(mark));
        let head = fields(head, mark);
        let columns = columns(&head).map_err(|reason| bad(first, reason))?;
        if columns.has_head {
            lines.next();
        }
        let mut sensors = Self::default();
        let mut points = Vec::new();
        for (line, text) in lines {
            let fields = fields(text, mark);
            if fields.len() != head.len() {
                let (found, wanted) = (fields.len(), head.len());
                let reason = format!("found {found} columns, wanted {wanted} as in line {first}");
                return Err(bad(line, reason));
            }
            let mut numbers = [f64::NAN; 6];
            for (number, (place, name)) in
                numbers.iter_mut().zip(columns.places.iter().zip(COLUMNS))
            {
                if let Some(place) = *place {
                    let found = self::number(fields[place]);
                    *number = found.map_err(|reason| bad(line, format!("{name}: {reason}")))?;
                }
            }
            let [x, y, z, nx, ny, nz] = numbers;
            points.push([x, y, z]);
            if columns.places[3].is_some() {
                sensors.normals.push([nx, ny, nz].map(|x| x as f32));
            }
            if columns.name.is_some() && sensors.labels.is_empty() {
                sensors.labels.push(Label::new("name", Vec::new()));
            }
            if let (Some(place), [label, ..]) = (columns.name, &mut sensors.labels[..]) {
                label.values.push(fields[place].to_owned());
            }
        }
        match points.is_empty() {
            true => Err(none(first)),
            false => Ok((sensors, points)),
        }
    }
}

fn bad(line: usize, reason: String) -> BadTable {
    BadTable { line, reason }
}

/// Fields of a line, between marks or else spaces. Marks inside of quotation marks belong to the field.
pub(crate) fn fields(line: &str, mark: Option<char>) -> Vec<&str> {
    let mut is_quoted = false;
    let is_end = |c: char| {
        is_quoted ^= c == '"';
        !is_quoted && mark.map_or(c.is_whitespace(), |mark| c == mark)
    };
    let fields = line.split(is_end);
    let fields = fields.map(|field| field.trim().trim_matches('"').trim());
    // Several spaces are one, but nothing between two marks is an empty field.
    fields
        .filter(|field| mark.is_some() || !field.is_empty())
        .collect()
}

fn number(field: &str) -> Result<f64, String> {
    match field.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ if has_decimal_comma(field) => Err(format!(
            "found {field:?} with a decimal comma, wanted a decimal point"
        )),
        _ => Err(format!("found {field:?}, wanted a number")),
    }
}

fn has_decimal_comma(field: &str) -> bool {
    field.contains(',') && field.replace(',', ".").parse::<f64>().is_ok()
}

/// Places of the columns of a table.
struct Columns {
    /// Places of the [`COLUMNS`] that the table has.
    places: [Option<usize>; 6],
    /// Names of points.
    name: Option<usize>,
    /// Whether the first line has the names of the columns.
    has_head: bool,
}

/// Columns by the first line of a table.
fn columns(head: &[&str]) -> Result<Columns, String> {
    let is_number = |field: &&str| field.parse::<f64>().is_ok() || has_decimal_comma(field);
    if head.iter().all(is_number) {
        return match head.len() {
            3 | 6 => Ok(Columns {
                places: std::array::from_fn(|place| (place < head.len()).then_some(place)),
                name: None,
                has_head: false,
            }),
            found => Err(format!(
                "found {found} columns without names, wanted x, y, z, or x, y, z, nx, ny, nz"
            )),
        };
    }
    let place = |name: &str| {
        let fields = head.iter().enumerate();
        let mut found = fields.filter(|(_, field)| field.eq_ignore_ascii_case(name));
        let first = found.next().map(|(place, _)| place);
        match found.next() {
            Some(_) => Err(format!("found the column {name} twice")),
            None => Ok(first),
        }
    };
    let mut places = [None; 6];
    for (found, name) in places.iter_mut().zip(COLUMNS) {
        *found = place(name)?;
    }
    let count = |places: &[Option<usize>]| places.iter().flatten().count();
    match (count(&places[..3]), count(&places[3..])) {
        (2 | 3, 0) | (3, 3) => Ok(Columns {
            places,
            name: place("name")?.or(place("id")?),
            has_head: true,
        }),
        _ => Err("found no columns x, y, z, or x, y, z, nx, ny, nz".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Sensors, BadTable> {
        Sensors::from_table(text, &LocalOrigin::default())
    }

    #[test]
    fn tables_are_read_by_names_or_places() {
        for text in [
            "1,2,3\n4,5,6\n",
            "# comment\nx,y,z\n1,2,3\n\n4,5,6",
            "id;z;y;x\na;3;2;1\nb;6;5;4\n",
            "1 2 3\n4  5 \t6",
            "\u{feff}x\ty\tz\r\n1\t2\t3\r\n4\t5\t6\r\n",
            "\"name\",\"x\",\"y\",\"z\"\n\"roof, north\",\"1\",2,3\n,4,5,6\n",
            "name x y z\n\"roof north\" 1 2 3\nwall 4 5 6\n",
        ] {
            let sensors = read(text).unwrap_or_else(|error| panic!("{text}: {error:?}"));
            assert_eq!(sensors.points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], "{text}");
            assert!(sensors.normals.is_empty());
        }
        let named = read("id,x,y\nroof,1,2\n").expect("a table");
        assert_eq!(named.labels, [Label::new("name", vec!["roof".into()])]);
        assert!(named.points[0][2].is_nan(), "a height that is missing");
        let with_normals = read("X,Y,Z,NX,NY,NZ\n1,2,3,0,0,1").expect("a table");
        assert_eq!(with_normals.normals, [[0.0, 0.0, 1.0]]);
    }

    #[test]
    fn mistakes_have_a_line_and_say_what_is_wrong() {
        for (text, line, word) in [
            ("", 1, "no points"),
            ("x,w\n1,2", 1, "x, y, z"),
            ("x,y,nx,ny,nz\n1,2,3,4,5", 1, "x, y, z"),
            ("x,y,z,nx\n1,2,3,4", 1, "nx, ny, nz"),
            ("1,2,3,4\n", 1, "4 columns"),
            ("1,2,3,4,5,6,7,8\n", 1, "8 columns"),
            (
                "x,y,z\n1,2,3\n1,2\n",
                3,
                "found 2 columns, wanted 3 as in line 1",
            ),
            ("x,y,z\n1,5,2,5,3,5\n", 2, "found 6 columns"),
            ("x,y,z\n1,2,inf\n", 2, "z: found \"inf\""),
            ("x,y,z\n1,,3\n", 2, "y: found \"\""),
            ("x,x,y,z\n1,2,3,4\n", 1, "column x twice"),
            (
                "x;y;z\n1,5;2,5;3,5\n",
                2,
                "x: found \"1,5\" with a decimal comma",
            ),
            ("1,5;2,5;3,5\n", 1, "decimal comma"),
            (
                "x\ty\tz\n1\t2,5\t3\n",
                2,
                "y: found \"2,5\" with a decimal comma",
            ),
            (
                "\"x\",\"y\",\"z\"\n\"1,5\",\"2,5\",\"3,5\"\n",
                2,
                "decimal comma",
            ),
            ("x y z\n1 2 3 4\n", 2, "found 4 columns"),
            ("x,y,z\n", 1, "no points"),
        ] {
            let error = read(text).expect_err(text);
            assert_eq!(error.line, line, "{text:?}: {error}");
            assert!(error.reason.contains(word), "{text:?}: {error}");
        }
    }
}
