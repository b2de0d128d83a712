#include "urban_gnss_localization/ros/error_plot.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "urban_gnss_localization/ros/pixel_canvas.hpp"

namespace urban_gnss {
namespace {

constexpr Colour kGridLine{0.82F, 0.84F, 0.87F, 1.0F};
constexpr double kLowest_m = 0.1;
constexpr double kLongestGap_s = 2.0;
constexpr int kMargin = 8;
constexpr int kWidthADot = 240;          // of the image, for letters that are legible in rviz
constexpr std::size_t kNumberWidth = 4;  // characters

/// Text of the size that fits the image.
struct Lettering {
  int scale;

  explicit Lettering(int width) : scale(std::max(1, width / kWidthADot)) {}
  int line_height() const { return (PixelCanvas::kGlyphHeight + 2) * scale + 2; }
  int width(const std::string& text) const { return PixelCanvas::text_width(text, scale); }
};

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), value < 10.0 ? "%.1f" : "%.0f", value);
  return std::isfinite(value) ? text : "-";
}

std::string padded(const std::string& text) {
  return text.size() < kNumberWidth ? std::string(kNumberWidth - text.size(), ' ') + text : text;
}

/// The decade above the largest error.
double highest(const std::vector<ErrorCurve>& curves) {
  double largest = 1.0;
  for (const ErrorCurve& curve : curves) {
    const double max = curve.errors.summary.position_m.max;
    if (std::isfinite(max)) largest = std::max(largest, max);
  }
  return std::pow(10.0, std::ceil(std::log10(largest)));
}

/// Where errors and times are in the image.
struct Axes {
  int left, right, top, bottom;
  double highest_m;
  Stamp now, window;

  int row(double error_m) const {
    const double share = std::log(std::max(error_m, kLowest_m) / kLowest_m) / std::log(highest_m / kLowest_m);
    return bottom - static_cast<int>(std::lround(share * (bottom - top)));
  }
  int column(Stamp stamp) const {
    return right - static_cast<int>(std::lround(to_seconds(now - stamp) / to_seconds(window) * (right - left)));
  }
};

void draw_grid(PixelCanvas& canvas, const Axes& axes, const Lettering& letters) {
  for (double error = kLowest_m; error < 1.5 * axes.highest_m; error *= 10.0) {
    for (int k = 1; k < 10 && k * error < 1.01 * axes.highest_m; ++k) {
      const int row = axes.row(k * error);
      canvas.line(axes.left, row, axes.right, row, 1, k == 1 ? Colour{0.55F, 0.57F, 0.6F, 1.0F} : kGridLine);
    }
    const std::string label = error < 0.99 ? number(error) : std::to_string(std::lround(error));
    canvas.text(label, axes.left - 4 - letters.width(label), axes.row(error) - 3 * letters.scale, letters.scale, kInk);
  }
  for (int k = 0; k <= 4; ++k) {
    const int column = axes.left + k * (axes.right - axes.left) / 4;
    canvas.line(column, axes.top, column, axes.bottom, 1, kGridLine);
    const std::string label = std::to_string(std::lround((k - 4) * to_seconds(axes.window) / 4));
    canvas.text(label, std::min(column - letters.width(label) / 2, axes.right - letters.width(label)),
                axes.bottom + 5 * letters.scale, letters.scale, kInk);
  }
}

void draw_curve(PixelCanvas& canvas, const Axes& axes, const ErrorCurve& curve) {
  const ErrorSample* last = nullptr;
  for (const ErrorSample& sample : curve.errors.samples) {
    if (sample.stamp < axes.now - axes.window) continue;
    if (last != nullptr && to_seconds(sample.stamp - last->stamp) < kLongestGap_s) {
      canvas.line(axes.column(last->stamp), axes.row(last->position_error_m), axes.column(sample.stamp),
                  axes.row(sample.position_error_m), 2, curve.colour);
    }
    last = &sample;
  }
}

}  // namespace

sensor_msgs::Image error_plot(const std::vector<ErrorCurve>& curves, Stamp now, Stamp window, int width, int height) {
  sensor_msgs::Image image;
  PixelCanvas canvas(image, width, height);
  const Lettering letters(width);
  const int line_height = letters.line_height();
  const int legend = (static_cast<int>(curves.size()) + 1) * line_height;
  const Axes axes{kMargin + letters.width("0.1") + 4,
                  width - kMargin,
                  kMargin + line_height,
                  height - legend - 2 * line_height,
                  highest(curves),
                  now,
                  window};
  const auto write = [&](const std::string& text, int left, int top) {
    canvas.text(text, left, top, letters.scale, kInk);
  };
  write("error in m over time in s", axes.left, kMargin - 2);
  draw_grid(canvas, axes, letters);
  for (const ErrorCurve& curve : curves) draw_curve(canvas, axes, curve);

  int row = height - legend - 2;
  const int swatch = 6 * letters.scale;
  const int numbers = width - kMargin - letters.width(std::string(3 * kNumberWidth, ' '));
  write(padded("now") + padded("rms") + padded("95"), numbers, row);
  for (const ErrorCurve& curve : curves) {
    row += line_height;
    canvas.line(kMargin, row + 2 * letters.scale, kMargin + swatch, row + 2 * letters.scale, 3 * letters.scale,
                curve.colour);
    write(curve.name, kMargin + swatch + 4 * letters.scale, row);
    const auto& samples = curve.errors.samples;
    const double latest = samples.empty() ? std::nan("") : samples.back().position_error_m;
    const auto& position_m = curve.errors.summary.position_m;
    write(padded(number(latest)) + padded(number(position_m.rmse)) + padded(number(position_m.p95)), numbers, row);
  }
  return image;
}

}  // namespace urban_gnss
