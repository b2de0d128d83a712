#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "messages/visibility_colours.hpp"
#include "urban_gnss_localization/geometry/angles.hpp"
#include "urban_gnss_localization/ros/pixel_canvas.hpp"
#include "urban_gnss_localization/ros/visibility_messages.hpp"

namespace urban_gnss {
namespace {

/// The sky about its zenith: azimuth clockwise from north, which is up; the horizon is a circle.
class SkyCanvas {
 public:
  SkyCanvas(sensor_msgs::Image& image, int size)
      : pixels_(image, size, size),
        size_(size),
        middle_(0.5 * (size - 1)),
        radius_(0.43 * size),
        scale_(std::max(1, size / 240)) {}

  double radius() const { return radius_; }
  double middle() const { return middle_; }

  void set(int column, int row, const Colour& colour) { pixels_.set(column, row, colour); }

  void disc(double azimuth_rad, double elevation_rad, const Colour& colour) {
    const auto [column, row] = place(azimuth_rad, elevation_rad);
    pixels_.disc(column, row, std::max(2, size_ / 55), colour, kInk);
  }

  /// Centred on a place of the sky, `below` heights of a line lower.
  void text(const std::string& text, double azimuth_rad, double elevation_rad, double below) {
    const auto [column, row] = place(azimuth_rad, elevation_rad);
    pixels_.text(text, column - PixelCanvas::text_width(text, scale_) / 2,
                 row + static_cast<int>(std::lround((below - 0.5) * PixelCanvas::kGlyphHeight * scale_)), scale_, kInk);
  }

 private:
  std::pair<int, int> place(double azimuth_rad, double elevation_rad) const {
    const double from_zenith = radius_ * (1.0 - elevation_rad / (0.5 * kPi));
    return {static_cast<int>(std::lround(middle_ + from_zenith * std::sin(azimuth_rad))),
            static_cast<int>(std::lround(middle_ - from_zenith * std::cos(azimuth_rad)))};
  }

  PixelCanvas pixels_;
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
