#pragma once

#include <sensor_msgs/Image.h>

#include <string>

#include "urban_gnss_localization/ros/marker_parts.hpp"

namespace urban_gnss {

/// Of text, on white.
inline constexpr Colour kInk{0.1F, 0.1F, 0.1F, 1.0F};

/// Draws into an image message, 8-bit RGB. Columns count to the right, rows downwards; what is outside is left out.
class PixelCanvas {
 public:
  static constexpr int kGlyphWidth = 5;
  static constexpr int kGlyphHeight = 7;

  /// Makes the image white, of this size. Keeps a reference to it.
  PixelCanvas(sensor_msgs::Image& image, int width, int height);

  void set(int column, int row, const Colour& colour);
  void disc(int column, int row, int radius, const Colour& colour, const Colour& rim);
  /// A straight line, `thickness` pixels wide.
  void line(int from_column, int from_row, int to_column, int to_row, int thickness, const Colour& colour);
  /// Capitals, digits and `.`, `-`, `_`, `?`, each dot `scale` pixels; small letters become capitals, all else is left
  /// blank. (left, top) is the corner.
  void text(const std::string& text, int left, int top, int scale, const Colour& colour);
  /// How wide a text is, in pixels.
  static int text_width(const std::string& text, int scale);

 private:
  sensor_msgs::Image& image_;
  int width_;
  int height_;
};

}  // namespace urban_gnss
