#pragma once

#include <atomic>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "urban_gnss_localization/common/progress.hpp"

namespace urban_gnss {

/// Does `total` jobs in `threads` threads, and shows on standard error how far they are and what `label` calls the job
/// that came on last. A job is given its index and a function to be told the share of it that is done, 0 to 1. The
/// first exception ends the work and is thrown again.
inline void run_jobs(std::size_t total, int threads, const std::function<std::string(std::size_t)>& label,
                     const std::function<void(std::size_t, const std::function<void(double)>&)>& job) {
  constexpr std::size_t kSteps = 1000;
  Progress progress(kSteps);
  std::vector<double> shares(total, 0.0);
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr failure;
  const auto work = [&] {
    for (std::size_t index = next++; index < total; index = next++) {
      try {
        job(index, [&](double share) {
          const std::lock_guard<std::mutex> lock(mutex);
          shares[index] = share;
          double sum = 0.0;
          for (const double each : shares) sum += each;
          progress.report(static_cast<std::size_t>(static_cast<double>(kSteps) * sum / static_cast<double>(total)),
                          label(index));
        });
      } catch (...) {
        const std::lock_guard<std::mutex> lock(mutex);
        if (!failure) failure = std::current_exception();
        next = total;
      }
    }
  };
  std::vector<std::thread> pool;
  for (int i = 0; i < threads; ++i) pool.emplace_back(work);
  for (std::thread& thread : pool) thread.join();
  progress.finish();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace urban_gnss
