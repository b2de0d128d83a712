#include "urban_gnss_localization/ros/tcp_lines.hpp"

#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <memory>

namespace urban_gnss {
namespace {

constexpr int kConnectTimeout_ms = 2000;
constexpr std::size_t kMostWithoutEnd = 1 << 20;

/// Whether the socket is ready for `events` within the time.
bool wait_for(int socket, short events, int timeout_ms) {
  pollfd entry{socket, events, 0};
  return poll(&entry, 1, timeout_ms) > 0;
}

/// 0, or the errno of the attempt.
int try_to_connect(int socket, const addrinfo& address) {
  if (connect(socket, address.ai_addr, address.ai_addrlen) == 0) return 0;
  if (errno != EINPROGRESS) return errno;
  if (!wait_for(socket, POLLOUT, kConnectTimeout_ms)) return ETIMEDOUT;
  int error = 0;
  socklen_t size = sizeof error;
  getsockopt(socket, SOL_SOCKET, SO_ERROR, &error, &size);
  return error;
}

}  // namespace

std::string TcpLines::open(const std::string& host, int port) {
  close();
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (const int error = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found)) {
    return gai_strerror(error);
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> addresses(found, freeaddrinfo);
  int error = 0;
  for (const addrinfo* address = found; address != nullptr; address = address->ai_next) {
    const int candidate = socket(address->ai_family, address->ai_socktype | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (candidate < 0) {
      error = errno;
      continue;
    }
    error = try_to_connect(candidate, *address);
    if (error == 0) {
      const int on = 1;
      setsockopt(candidate, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);  // a host that vanished is noticed in the end
      socket_ = candidate;
      return "";
    }
    ::close(candidate);
  }
  return std::strerror(error);
}

void TcpLines::send(const std::string& text) {
  if (is_open() && ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(text.size()))
    close();
}

std::optional<std::string> TcpLines::read_line(double timeout_s) {
  while (is_open()) {
    const std::size_t end = received_.find('\n');
    if (end != std::string::npos) {
      std::string line = received_.substr(0, end);
      received_.erase(0, end + 1);
      if (!line.empty() && line.back() == '\r') line.pop_back();
      return line;
    }
    if (received_.size() > kMostWithoutEnd) break;
    if (!wait_for(socket_, POLLIN, static_cast<int>(std::lround(1000.0 * timeout_s)))) return std::nullopt;
    std::array<char, 4096> bytes;
    const ssize_t count = recv(socket_, bytes.data(), bytes.size(), 0);
    if (count > 0) {
      received_.append(bytes.data(), static_cast<std::size_t>(count));
    } else if (count == 0 || (errno != EAGAIN && errno != EINTR)) {
      break;
    }
  }
  close();
  return std::nullopt;
}

void TcpLines::close() {
  if (is_open()) ::close(socket_);
  socket_ = -1;
  received_.clear();
}

}  // namespace urban_gnss
