#pragma once

#include <optional>
#include <string>

namespace urban_gnss {

/// A TCP connection that brings lines.
class TcpLines {
 public:
  TcpLines() = default;
  ~TcpLines() { close(); }
  TcpLines(const TcpLines&) = delete;
  TcpLines& operator=(const TcpLines&) = delete;

  /// The reason, where it cannot connect within two seconds; empty where it could.
  std::string open(const std::string& host, int port);
  bool is_open() const { return socket_ >= 0; }
  /// Closes the connection where it cannot send.
  void send(const std::string& text);
  /// The next line without its end; nothing where none came within `timeout_s`, or the connection ended: is_open()
  /// tells which. A line of more than a megabyte ends the connection.
  std::optional<std::string> read_line(double timeout_s);
  void close();

 private:
  int socket_{-1};
  std::string received_;
};

}  // namespace urban_gnss
