//! Pictures encoded as PNG files.

/// Picture of sRGB texels with linear alpha, in rows from the top.
pub(super) struct Picture {
    width: u32,
    height: u32,
    texels: Vec<[u8; 4]>,
}

impl Picture {
    /// Creates a picture. `texel` returns the RGBA texel at a column and row.
    pub(super) fn new([width, height]: [u32; 2], texel: impl Fn(u32, u32) -> [u8; 4]) -> Self {
        let texel = &texel;
        let texels = (0..height).flat_map(|row| (0..width).map(move |column| texel(column, row))).collect();
        Self { width, height, texels }
    }

    /// Encodes a PNG file, without an alpha channel if the picture is opaque.
    pub(super) fn png(&self) -> Vec<u8> {
        let is_opaque = self.texels.iter().all(|texel| texel[3] == u8::MAX);
        let (colour, channels) = if is_opaque { (png::ColorType::Rgb, 3) } else { (png::ColorType::Rgba, 4) };
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, self.width, self.height);
        encoder.set_color(colour);
        encoder.set_depth(png::BitDepth::Eight);
        let bytes: Vec<u8> = self.texels.iter().flat_map(|texel| &texel[..channels]).copied().collect();
        let mut writer = encoder.write_header().expect("the header of a picture in memory");
        writer.write_image_data(&bytes).expect("as many bytes as the header says");
        writer.finish().expect("the end of a picture in memory");
        file
    }
}
