//! Reader of Radiance pictures, `.hdr` and `.pic` (Ward, "Real Pixels", Graphics Gems II, 1991; "Radiance
//! Picture File Format", <https://radsite.lbl.gov/radiance/refer/filefmts.pdf>).

use photoncard_picture::allocation;

use super::map_size::check_map_size;
use super::raster::Fault;

/// First bytes of a file; the name of a program follows.
pub(super) const MAGIC: &[u8] = b"#?";

/// Maximum size of a header, bytes.
const MAX_HEADER: usize = 1 << 16;

/// Maximum number of texels per byte. Two bytes encode a run of up to 127 values of one of four channels.
const TEXELS_OF_A_BYTE: u64 = 16;

/// Widths of rows whose channels may be run-length encoded.
const ENCODED_WIDTHS: std::ops::Range<usize> = 8..32_768;

const EXPORT_AGAIN: &str =
    "export the picture again, or copy it again: it is damaged or was cut off on the way";

fn damaged(reason: impl Into<String>) -> Fault {
    Fault::unreadable(reason.into(), EXPORT_AGAIN)
}

fn ends_early() -> Fault {
    damaged("the picture ends before its last row")
}

struct Header {
    size: [u32; 2],
    /// True if the file's first column is the rightmost one, and true if its first row is the lowest.
    flipped: [bool; 2],
    /// Factor by which the stored radiance was multiplied.
    exposure: f32,
}

/// Decodes a file. Returns its width and height, and radiance in rows from the top.
pub(super) fn read(bytes: &[u8]) -> Result<([u32; 2], Vec<[f32; 3]>), Fault> {
    let (header, mut rest) = read_header(bytes)?;
    check_map_size(header.size)?;
    let [width, height] = header.size.map(|side| side as usize);
    if (width * height) as u64 > TEXELS_OF_A_BYTE * bytes.len() as u64 {
        return Err(damaged(format!("{width} x {height} texels do not fit into {} bytes", bytes.len())));
    }
    allocation::check((width * height * size_of::<[f32; 3]>()) as u64).map_err(Fault::memory)?;
    let mut texels = vec![[0.0; 3]; width * height];
    let mut row = vec![[0; 4]; width];
    for y in 0..height {
        rest = read_row(rest, &mut row)?;
        let y = if header.flipped[1] { height - 1 - y } else { y };
        let target = &mut texels[y * width..][..width];
        for (texel, shared) in target.iter_mut().zip(&row) {
            *texel = radiance(*shared, header.exposure);
        }
        if header.flipped[0] {
            target.reverse();
        }
    }
    Ok((header.size, texels))
}

/// Computes `m 2^(e - 136) / exposure` for three mantissas `m` with a common exponent `e`; `e = 0` is black.
/// Some readers add 1/2 to every mantissa; this one does not.
fn radiance([red, green, blue, exponent]: [u8; 4], exposure: f32) -> [f32; 3] {
    if exponent == 0 {
        return [0.0; 3];
    }
    let scale = libm::ldexp(1.0, i32::from(exponent) - 128 - 8) / f64::from(exposure);
    [red, green, blue].map(|mantissa| (f64::from(mantissa) * scale) as f32)
}

/// Parses the header. Returns it and the bytes after it.
fn read_header(bytes: &[u8]) -> Result<(Header, &[u8]), Fault> {
    let (mut exposure, mut rest) = (1.0_f32, bytes);
    loop {
        let line = next_line(&mut rest)?;
        if line.is_empty() {
            break;
        }
        let Some((name, value)) = line.split_once('=') else { continue };
        match (name.trim(), value.trim()) {
            ("FORMAT", "32-bit_rle_rgbe") => {}
            ("FORMAT", other) => {
                let reason = format!("its texels are {other:.40}, and only 32-bit_rle_rgbe is read");
                return Err(Fault::unreadable(reason, "store the picture as RGB, not XYZ"));
            }
            // Several exposures multiply.
            ("EXPOSURE", value) => {
                let factor = value.parse::<f32>().ok().filter(|factor| factor.is_normal() && *factor > 0.0);
                exposure *= factor.ok_or_else(|| damaged(format!("its exposure is {value:.40}")))?;
            }
            _ => {}
        }
    }
    if !(exposure.is_normal() && exposure > 0.0) {
        return Err(damaged(format!("its exposures multiply to {exposure}")));
    }
    let resolution = next_line(&mut rest)?;
    let (size, flipped) = parse_resolution(&resolution).ok_or_else(|| {
        Fault::unreadable(
            format!("its rows are stated as {resolution:.40}"),
            "store the picture in rows, from the top: -Y HEIGHT +X WIDTH",
        )
    })?;
    Ok((Header { size, flipped, exposure }, rest))
}

/// Removes the next line of the header from `rest` and returns it.
fn next_line(rest: &mut &[u8]) -> Result<String, Fault> {
    let header = rest.get(..MAX_HEADER.min(rest.len())).unwrap_or_default();
    let end =
        header.iter().position(|&byte| byte == b'\n').ok_or_else(|| damaged("its header has no end"))?;
    let line = String::from_utf8_lossy(&header[..end]).trim_end_matches('\r').to_owned();
    *rest = &rest[end + 1..];
    Ok(line)
}

/// Parses `-Y HEIGHT +X WIDTH` with any signs. Returns the size, and whether columns and rows are reversed.
fn parse_resolution(line: &str) -> Option<([u32; 2], [bool; 2])> {
    let words: Vec<_> = line.split_whitespace().collect();
    let &[y, height, x, width] = &words[..] else { return None };
    let flipped = [("-X", "+X", x), ("+Y", "-Y", y)].map(|(turned, straight, word)| match word {
        word if word == turned => Some(true),
        word if word == straight => Some(false),
        _ => None,
    });
    Some(([width.parse().ok()?, height.parse().ok()?], [flipped[0]?, flipped[1]?]))
}

/// Reads a row. Returns the bytes after it.
fn read_row<'a>(rest: &'a [u8], row: &mut [[u8; 4]]) -> Result<&'a [u8], Fault> {
    let width = row.len();
    if let Some(&[2, 2, high, low]) = rest.first_chunk::<4>()
        && high < 128
        && ENCODED_WIDTHS.contains(&width)
    {
        if usize::from(high) << 8 | usize::from(low) != width {
            return Err(damaged("a row is of another length than the picture's"));
        }
        return read_encoded(&rest[4..], row);
    }
    let (texels, rest) = rest.split_at_checked(4 * width).ok_or_else(ends_early)?;
    row.copy_from_slice(texels.as_chunks().0);
    if row.iter().any(|texel| texel.starts_with(&[1, 1, 1])) {
        let reason = "its rows are run-length encoded in the way of before 1991".to_owned();
        return Err(Fault::unreadable(reason, "store the picture again with a newer program"));
    }
    Ok(rest)
}

/// Reads a run-length encoded row: the channels one after another, in runs and literals.
fn read_encoded<'a>(mut rest: &'a [u8], row: &mut [[u8; 4]]) -> Result<&'a [u8], Fault> {
    for channel in 0..4 {
        let mut done = 0;
        while done < row.len() {
            let (&code, after) = rest.split_first().ok_or_else(ends_early)?;
            let (count, is_run) = if code > 128 { (code - 128, true) } else { (code, false) };
            let count = usize::from(count);
            let target = row.get_mut(done..done + count).filter(|target| !target.is_empty());
            let target =
                target.ok_or_else(|| damaged("a run of texels is empty, or reaches beyond its row"))?;
            let (values, after) =
                after.split_at_checked(if is_run { 1 } else { count }).ok_or_else(ends_early)?;
            for (texel, value) in target.iter_mut().zip(values.iter().cycle()) {
                texel[channel] = *value;
            }
            (done, rest) = (done + count, after);
        }
    }
    Ok(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(header: &str, data: &[u8]) -> Vec<u8> {
        [b"#?RADIANCE\n", header.as_bytes(), data].concat()
    }

    const FORMAT: &str = "FORMAT=32-bit_rle_rgbe\n\n";

    #[test]
    fn flat_rows_of_any_order_are_read_from_the_top() {
        let data = [128, 64, 0, 129, 255, 255, 255, 0, 1, 0, 0, 136, 0, 0, 2, 137];
        let texels = [[1.0, 0.5, 0.0], [0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 4.0]];
        let cases = [
            ("-Y 2 +X 2", [0, 1, 2, 3]),
            ("+Y 2 +X 2", [2, 3, 0, 1]),
            ("-Y 2 -X 2", [1, 0, 3, 2]),
            ("+Y 2 -X 2", [3, 2, 1, 0]),
        ];
        for (resolution, order) in cases {
            let bytes = picture(&format!("{FORMAT}{resolution}\n"), &data);
            assert_eq!(read(&bytes), Ok(([2, 2], order.map(|index| texels[index]).to_vec())), "{resolution}");
        }
    }

    #[test]
    fn encoded_rows_are_runs_and_values_by_channel() {
        let mut data = vec![2, 2, 0, 9];
        data.extend([137, 128, 4, 0, 64, 0, 64, 133, 0, 137, 0, 137, 129]);
        let bytes = picture(&format!("{FORMAT}-Y 1 +X 9\n"), &data);
        let (size, texels) = read(&bytes).unwrap();
        assert_eq!(size, [9, 1]);
        let green = [0.0, 0.5, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(texels, green.map(|green| [1.0, green, 0.0]));
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length]).is_err(), "{length}");
        }
    }

    #[test]
    fn the_radiance_is_divided_by_the_exposure() {
        let bytes = picture(&format!("EXPOSURE=2\nEXPOSURE= 4\n{FORMAT}-Y 1 +X 1\n"), &[128, 0, 0, 129]);
        assert_eq!(read(&bytes).unwrap().1, [[0.125, 0.0, 0.0]]);
    }

    #[test]
    fn invalid_headers_and_rows_are_refused() {
        let cases = [
            ("FORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n", "xyze"),
            ("EXPOSURE=0\n\n-Y 1 +X 1\n", "exposure"),
            ("\n+X 1 -Y 1\n", "+X 1 -Y 1"),
            ("\n-Y 1 +X 100000\n", "100000 x 1"),
            ("\n-Y 0 +X 1\n", "no texels"),
            ("\n-Y 8192 +X 8192\n", "do not fit"),
            ("\n-Y 8192 +X 8193\n", "67108864 in all"),
            ("\n-Y 1 +X 2\n", "ends"),
            ("no end", "header"),
        ];
        for (header, part) in cases {
            let fault = read(&picture(header, &[1, 2, 3, 4])).unwrap_err();
            assert!(fault.reason.contains(part), "{header}: {fault:?}");
        }
        let old = read(&picture("\n-Y 1 +X 2\n", &[5, 5, 5, 128, 1, 1, 1, 1])).unwrap_err();
        assert!(old.reason.contains("1991"), "{old:?}");
        let run = read(&picture("\n-Y 1 +X 8\n", &[2, 2, 0, 8, 137, 1])).unwrap_err();
        assert!(run.reason.contains("beyond"), "{run:?}");
    }
}
