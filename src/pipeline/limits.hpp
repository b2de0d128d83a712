#pragma once

#include <cstddef>
#include <deque>
#include <utility>

namespace urban_gnss {

/// How long a pipeline remembers odometry, yaw rates and estimates.
inline constexpr double kHistory_s = 10.0;
/// A fix, velocity or yaw rate that is farther ahead of the odometry than this has a wrong stamp.
inline constexpr double kMaxAhead_s = 10.0;
/// How many fixes, velocities or biases may wait for what they need.
inline constexpr std::size_t kMaxWaiting = 1000;

/// Appends to a queue that holds kMaxWaiting at most; the oldest goes first.
template <class T, class U>
void push_bounded(std::deque<T>& queue, U&& element) {
  if (queue.size() >= kMaxWaiting) queue.pop_front();
  queue.push_back(std::forward<U>(element));
}

}  // namespace urban_gnss
