#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/ros/visibility_messages.hpp"
#include "visibility_colours.hpp"

namespace urban_gnss {
namespace {

constexpr int kGlyphWidth = 5;
constexpr int kGlyphHeight = 7;

/// A character of the names of satellites and directions; a row's leftmost dot is its bit 4.
struct Glyph {
  char character;
  std::array<std::uint8_t, kGlyphHeight> rows;
};
constexpr Glyph kGlyphs[] = {
    {'0', {0x0E, 0x11, 0x13, 0x15, 0x19, 0x11, 0x0E}}, {'1', {0x04, 0x0C, 0x04, 0x04, 0x04, 0x04, 0x0E}},
    {'2', {0x0E, 0x11, 0x01, 0x06, 0x08, 0x10, 0x1F}}, {'3', {0x1E, 0x01, 0x01, 0x0E, 0x01, 0x01, 0x1E}},
    {'4', {0x02, 0x06, 0x0A, 0x12, 0x1F, 0x02, 0x02}}, {'5', {0x1F, 0x10, 0x1E, 0x01, 0x01, 0x11, 0x0E}},
    {'6', {0x06, 0x08, 0x10, 0x1E, 0x11, 0x11, 0x0E}}, {'7', {0x1F, 0x01, 0x02, 0x04, 0x08, 0x08, 0x08}},
    {'8', {0x0E, 0x11, 0x11, 0x0E, 0x11, 0x11, 0x0E}}, {'9', {0x0E, 0x11, 0x11, 0x0F, 0x01, 0x02, 0x0C}},
    {'?', {0x0E, 0x11, 0x01, 0x06, 0x04, 0x00, 0x04}}, {'C', {0x0E, 0x11, 0x10, 0x10, 0x10, 0x11, 0x0E}},
    {'E', {0x1F, 0x10, 0x10, 0x1E, 0x10, 0x10, 0x1F}}, {'G', {0x0E, 0x11, 0x10, 0x17, 0x11, 0x11, 0x0E}},
    {'I', {0x0E, 0x04, 0x04, 0x04, 0x04, 0x04, 0x0E}}, {'J', {0x07, 0x02, 0x02, 0x02, 0x02, 0x12, 0x0C}},
    {'N', {0x11, 0x19, 0x15, 0x13, 0x11, 0x11, 0x11}}, {'R', {0x1E, 0x11, 0x11, 0x1E, 0x14, 0x12, 0x11}},
    {'S', {0x0F, 0x10, 0x10, 0x0E, 0x01, 0x01, 0x1E}}, {'W', {0x11, 0x11, 0x11, 0x15, 0x15, 0x1B, 0x11}},
};

/// The sky about its zenith: azimuth clockwise from north, which is up; the horizon is a circle.
class SkyCanvas {
 public:
  SkyCanvas(sensor_msgs::Image& image, int size)
      : image_(image), size_(size), middle_(0.5 * (size - 1)), radius_(0.43 * size), scale_(std::max(1, size / 240)) {}

  double radius() const { return radius_; }
  double middle() const { return middle_; }

  void set(int column, int row, const Colour& colour) {
    if (column < 0 || row < 0 || column >= size_ || row >= size_) return;
    const std::size_t at = static_cast<std::size_t>(row) * image_.step + 3 * static_cast<std::size_t>(column);
    const float rgb[] = {colour.r, colour.g, colour.b};
    for (std::size_t k = 0; k < 3; ++k) image_.data[at + k] = static_cast<std::uint8_t>(std::lround(255.0F * rgb[k]));
  }

  void disc(double azimuth_rad, double elevation_rad, const Colour& colour) {
    const int disc = std::max(2, size_ / 55);
    const auto [column, row] = place(azimuth_rad, elevation_rad);
    for (int dr = -disc; dr <= disc; ++dr) {
      for (int dc = -disc; dc <= disc; ++dc) {
        const int squared = dr * dr + dc * dc;
        if (squared > disc * disc) continue;
        const bool is_rim = squared > (disc - 1) * (disc - 1);
        set(column + dc, row + dr, is_rim ? kInk : colour);
      }
    }
  }

  /// Centred on a place of the sky, `below` heights of a line lower.
  void text(const std::string& text, double azimuth_rad, double elevation_rad, double below) {
    const auto [column, row] = place(azimuth_rad, elevation_rad);
    const int advance = (kGlyphWidth + 1) * scale_;
    int left = column - (static_cast<int>(text.size()) * advance - scale_) / 2;
    const int top = row + static_cast<int>(std::lround((below - 0.5) * kGlyphHeight * scale_));
    for (const char character : text) {
      for (const Glyph& glyph : kGlyphs) {
        if (glyph.character == character) draw(glyph, left, top);
      }
      left += advance;
    }
  }

 private:
  static constexpr Colour kInk{0.1F, 0.1F, 0.1F, 1.0F};

  std::pair<int, int> place(double azimuth_rad, double elevation_rad) const {
    const double from_zenith = radius_ * (1.0 - elevation_rad / (0.5 * kPi));
    return {static_cast<int>(std::lround(middle_ + from_zenith * std::sin(azimuth_rad))),
            static_cast<int>(std::lround(middle_ - from_zenith * std::cos(azimuth_rad)))};
  }

  void draw(const Glyph& glyph, int left, int top) {
    for (int row = 0; row < kGlyphHeight * scale_; ++row) {
      for (int column = 0; column < kGlyphWidth * scale_; ++column) {
        const int bit = kGlyphWidth - 1 - column / scale_;
        if ((glyph.rows[static_cast<std::size_t>(row / scale_)] >> bit & 1) != 0) set(left + column, top + row, kInk);
      }
    }
  }

  sensor_msgs::Image& image_;
  int size_;
  double middle_;
  double radius_;  ///< of the horizon
  int scale_;      ///< pixels a dot of a glyph
};

}  // namespace

sensor_msgs::Image sky_plot(const urban_gnss_localization::Visibility& visibility, const std::vector<double>& skyline,
                            int size) {
  sensor_msgs::Image image;
  image.header = visibility.header;
  image.encoding = sensor_msgs::image_encodings::RGB8;
  image.width = image.height = static_cast<std::uint32_t>(size);
  image.step = 3 * image.width;
  image.data.assign(static_cast<std::size_t>(image.step) * image.height, 255);
  SkyCanvas canvas(image, size);
  for (int row = 0; row < size; ++row) {
    for (int column = 0; column < size; ++column) {
      const double east = (column - canvas.middle()) / canvas.radius();
      const double north = (canvas.middle() - row) / canvas.radius();
      const double from_zenith = std::hypot(east, north);
      if (from_zenith > 1.0) continue;
      const double elevation = 0.5 * kPi * (1.0 - from_zenith);
      bool is_blocked = false;
      if (!skyline.empty()) {
        const double turns = std::atan2(east, north) / (2.0 * kPi);
        const auto steps = static_cast<double>(skyline.size());
        const auto step = static_cast<std::size_t>(std::lround((turns - std::floor(turns)) * steps)) % skyline.size();
        is_blocked = elevation <= skyline[step];
      }
      // Circles every 30 degrees and the cross of the four directions.
      const double ring = std::abs(std::remainder(elevation, kPi / 6.0)) * canvas.radius() / (0.5 * kPi);
      const bool is_line =
          ring < 0.5 || std::abs(column - canvas.middle()) < 0.5 || std::abs(row - canvas.middle()) < 0.5;
      canvas.set(column, row,
                 is_line      ? Colour{0.75F, 0.78F, 0.82F, 1.0F}
                 : is_blocked ? Colour{0.58F, 0.56F, 0.54F, 1.0F}
                              : Colour{0.9F, 0.95F, 1.0F, 1.0F});
    }
  }
  const char* const directions[] = {"N", "E", "S", "W"};
  for (int i = 0; i < 4; ++i) canvas.text(directions[i], 0.5 * kPi * i, -0.04 * kPi, 0.0);
  for (const auto& satellite : visibility.satellites) {
    if (!std::isfinite(satellite.azimuth) || !(satellite.elevation >= 0.0F)) continue;
    canvas.disc(satellite.azimuth, satellite.elevation, colour_of(satellite.visibility));
    canvas.text(satellite.name, satellite.azimuth, satellite.elevation, 1.3);
  }
  return image;
}

}  // namespace urban_gnss
