#include "bag_file.hpp"

#include <rosbag/chunked_file.h>
#include <rosbag/constants.h>
#include <rosbag/exceptions.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <utility>

namespace urban_gnss {
namespace {

constexpr std::string_view kMagic = "#ROSBAG V2.0\n";
constexpr std::string_view kAnyMagic = "#ROSBAG V";
constexpr std::uint64_t kLongestHeader = 1 << 24;    // the definition of a message is in the data, not here
constexpr std::uint64_t kLongestChunk = 1ULL << 30;  // rosbag begins another one after 768 KiB
constexpr std::int64_t kNanosecondsInSecond = 1000000000;

/// What is wrong with some bytes, without the file's name.
class Damage : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Bytes that are read from the front. Throws Damage where there are too few.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : text_(reinterpret_cast<const char*>(data), size) {}
  explicit Bytes(std::string_view text) : text_(text) {}

  bool empty() const { return text_.empty(); }
  std::string_view take(std::size_t size) {
    if (size > text_.size()) throw Damage("a record is longer than what holds it");
    const std::string_view taken = text_.substr(0, size);
    text_.remove_prefix(size);
    return taken;
  }
  template <class T>
  T number() {
    T value{};
    std::memcpy(&value, take(sizeof(T)).data(), sizeof(T));
    return value;
  }
  std::string_view sized() { return take(number<std::uint32_t>()); }
  Stamp time() {
    const auto seconds = static_cast<std::int64_t>(number<std::uint32_t>());
    return Stamp(kNanosecondsInSecond * seconds + static_cast<std::int64_t>(number<std::uint32_t>()));
  }

 private:
  std::string_view text_;
};

/// The fields NAME=VALUE of a record.
class Fields {
 public:
  explicit Fields(std::string_view header) : header_(header) {
    for (Bytes rest(header); !rest.empty();) {
      if (rest.sized().find('=') == std::string_view::npos) throw Damage("a field has no name");
    }
  }
  /// Empty where there is none.
  std::string_view text(std::string_view name) const {
    for (Bytes rest(header_); !rest.empty();) {
      const std::string_view field = rest.sized();
      if (field.size() > name.size() && field[name.size()] == '=' && field.substr(0, name.size()) == name) {
        return field.substr(name.size() + 1);
      }
    }
    return {};
  }
  /// A value of a fixed size.
  Bytes value(std::string_view name, std::size_t size) const {
    const std::string_view value = text(name);
    if (value.size() != size) throw Damage("a record has no field \"" + std::string(name) + "\" of the right size");
    return Bytes(value);
  }
  template <class T>
  T number(std::string_view name) const {
    return value(name, sizeof(T)).number<T>();
  }
  Stamp time(std::string_view name) const { return value(name, 2 * sizeof(std::uint32_t)).time(); }
  std::uint8_t op() const { return number<std::uint8_t>("op"); }
  void require_op(std::uint8_t op, const char* what) const {
    if (this->op() != op) throw Damage(std::string("where ") + what + " should be is something else");
  }

 private:
  std::string_view header_;
};

}  // namespace

/// One record of the file: its header, where its data lie, and perhaps the data.
struct BagFile::Record {
  std::vector<std::uint8_t> header;
  std::vector<std::uint8_t> data;
  std::uint64_t data_position{0};
  std::uint64_t data_size{0};

  Fields fields() const {
    return Fields(std::string_view(reinterpret_cast<const char*>(header.data()), header.size()));
  }
  std::uint64_t end() const { return data_position + data_size; }
};

BagFile::BagFile(const std::string& path) : path_(path) {
  open();
  try {
    const Record record = read_record(kMagic.size(), false);
    const Fields fields = record.fields();
    fields.require_op(rosbag::OP_FILE_HEADER, "the file's header");
    if (!fields.text("encryptor").empty()) throw BagError(path_ + ": is encrypted, which is not supported");
    const auto index = fields.number<std::uint64_t>("index_pos");
    if (index == 0) {
      throw BagError(path_ + ": has no index, for its recording was not ended: rosbag reindex " + path_);
    }
    read_index(index, fields.number<std::uint32_t>("conn_count"), fields.number<std::uint32_t>("chunk_count"));
  } catch (const Damage& damage) {
    fail_as_damaged(damage.what());
  }
}

void BagFile::open() {
  std::error_code error;
  if (!std::filesystem::exists(path_, error)) throw BagError(path_ + ": no such bag");
  if (std::filesystem::is_directory(path_, error)) throw BagError(path_ + ": is a folder, no bag");
  file_.open(path_, std::ios::binary);
  if (!file_) throw BagError(path_ + ": cannot be read: " + std::strerror(errno));
  file_.seekg(0, std::ios::end);
  size_ = file_ ? static_cast<std::uint64_t>(file_.tellg()) : 0;
  if (size_ == 0) throw BagError(path_ + ": is empty, no bag");
  const std::vector<std::uint8_t> bytes = read_bytes(0, std::min<std::uint64_t>(size_, kMagic.size()));
  const std::string_view magic(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (magic == kMagic) return;
  if (magic.substr(0, kAnyMagic.size()) == kAnyMagic) {
    throw BagError(path_ + ": is of another version than 2.0, or damaged: rosbag reindex " + path_);
  }
  throw BagError(path_ + ": is no bag; one begins with #ROSBAG V2.0");
}

void BagFile::fail_as_damaged(const std::string& what) const {
  throw BagError(path_ + ": the bag is damaged or cut off (" + what + "): rosbag reindex " + path_);
}

std::vector<std::uint8_t> BagFile::read_bytes(std::uint64_t position, std::uint64_t size) {
  std::vector<std::uint8_t> bytes;
  read_bytes(position, size, bytes);
  return bytes;
}

void BagFile::read_bytes(std::uint64_t position, std::uint64_t size, std::vector<std::uint8_t>& bytes) {
  if (position > size_ || size > size_ - position) throw Damage("a record ends after the file");
  bytes.resize(size);
  file_.clear();
  file_.seekg(static_cast<std::streamoff>(position));
  file_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (!file_) throw Damage("it cannot be read");
}

BagFile::Record BagFile::read_record(std::uint64_t position, bool with_data) {
  const auto read_size = [this](std::uint64_t where) {
    const std::vector<std::uint8_t> bytes = read_bytes(where, sizeof(std::uint32_t));
    return Bytes(bytes.data(), bytes.size()).number<std::uint32_t>();
  };
  Record record;
  const std::uint32_t header_size = read_size(position);
  if (header_size > kLongestHeader) throw Damage("a header is too long");
  record.header = read_bytes(position + sizeof(std::uint32_t), header_size);
  const std::uint64_t data_size_position = position + sizeof(std::uint32_t) + header_size;
  record.data_size = read_size(data_size_position);
  record.data_position = data_size_position + sizeof(std::uint32_t);
  if (record.data_size > size_ - record.data_position) throw Damage("a record ends after the file");
  if (with_data) record.data = read_bytes(record.data_position, record.data_size);
  return record;
}

void BagFile::read_index(std::uint64_t position, std::uint32_t connection_count, std::uint32_t chunk_count) {
  const std::uint64_t begin = position;
  for (std::uint32_t i = 0; i < connection_count; ++i) {
    const Record record = read_record(position, true);
    add_connection(record);
    position = record.end();
  }
  for (std::uint32_t i = 0; i < chunk_count; ++i) {
    const Record record = read_record(position, true);
    add_chunk(record, begin);
    position = record.end();
  }
}

void BagFile::add_connection(const Record& record) {
  const Fields fields = record.fields();
  fields.require_op(rosbag::OP_CONNECTION, "a connection");
  const Fields header(std::string_view(reinterpret_cast<const char*>(record.data.data()), record.data.size()));
  BagConnection connection;
  connection.bag = path_;
  connection.topic = fields.text("topic");
  connection.type = header.text("type");
  connection.md5sum = header.text("md5sum");
  connection.definition = header.text("message_definition");
  connections_[fields.number<ConnectionId>("conn")] = std::make_shared<const BagConnection>(std::move(connection));
}

void BagFile::add_chunk(const Record& record, std::uint64_t end) {
  const Fields fields = record.fields();
  fields.require_op(rosbag::OP_CHUNK_INFO, "what is known of a chunk");
  Chunk chunk;
  chunk.position = fields.number<std::uint64_t>("chunk_pos");
  if (chunk.position >= end) throw Damage("a chunk lies after the index");
  chunk.first = fields.time("start_time");
  chunk.last = fields.time("end_time");
  Bytes counts(record.data.data(), record.data.size());
  for (auto i = fields.number<std::uint32_t>("count"); i > 0; --i) {
    const auto connection = counts.number<ConnectionId>();
    if (connections_.count(connection) == 0) throw Damage("a chunk has a connection that is not known");
    const auto messages = counts.number<std::uint32_t>();
    if (messages > 0) chunk.counts[connection] += messages;
  }
  chunks_.push_back(std::move(chunk));
}

std::shared_ptr<std::vector<std::uint8_t>> BagFile::free_buffer() {
  for (const auto& buffer : buffers_) {
    if (buffer.use_count() == 1) return buffer;
  }
  buffers_.push_back(std::make_shared<std::vector<std::uint8_t>>());
  return buffers_.back();
}

std::shared_ptr<const std::vector<std::uint8_t>> BagFile::read_chunk(std::uint64_t position) {
  const Record record = read_record(position, false);
  const Fields fields = record.fields();
  fields.require_op(rosbag::OP_CHUNK, "a chunk");
  const std::string_view kind = fields.text("compression");
  const auto size = fields.number<std::uint32_t>("size");
  const auto bytes = free_buffer();
  if (kind == rosbag::COMPRESSION_NONE) {
    if (size != record.data_size) throw Damage("a chunk has another size than it says");
    read_bytes(record.data_position, size, *bytes);
    return bytes;
  }
  if (kind != rosbag::COMPRESSION_BZ2 && kind != rosbag::COMPRESSION_LZ4) {
    throw Damage("a chunk is compressed in an unknown way");
  }
  if (size > kLongestChunk) throw Damage("a chunk is too long");
  read_bytes(record.data_position, record.data_size, compressed_);
  bytes->resize(size);
  if (size == 0) return bytes;
  try {
    rosbag::ChunkedFile().decompress(
        kind == rosbag::COMPRESSION_BZ2 ? rosbag::compression::BZ2 : rosbag::compression::LZ4, bytes->data(), size,
        compressed_.data(), static_cast<unsigned>(compressed_.size()));
  } catch (const rosbag::BagException& error) {
    throw Damage(error.what());
  }
  return bytes;
}

std::vector<BagMessage> BagFile::read(const Chunk& chunk, const std::set<ConnectionId>& wanted) {
  struct Found {
    const std::shared_ptr<const BagConnection>* connection;
    bool is_wanted;
    std::uint32_t count{0};
  };
  std::vector<BagMessage> messages;
  try {
    const auto bytes = read_chunk(chunk.position);
    std::map<ConnectionId, Found> all;
    for (Bytes rest(bytes->data(), bytes->size()); !rest.empty();) {
      const Fields fields(rest.sized());
      const std::string_view data = rest.sized();
      if (fields.op() == rosbag::OP_CONNECTION) continue;
      fields.require_op(rosbag::OP_MSG_DATA, "a message");
      const auto id = fields.number<ConnectionId>("conn");
      auto found = all.find(id);
      if (found == all.end()) {
        const auto connection = connections_.find(id);
        if (connection == connections_.end()) throw Damage("a message has a connection that is not known");
        found = all.emplace(id, Found{&connection->second, wanted.count(id) > 0}).first;
      }
      ++found->second.count;
      if (!found->second.is_wanted) continue;
      messages.emplace_back(*found->second.connection, fields.time("time"), bytes, data);
    }
    std::map<ConnectionId, std::uint32_t> counts;
    for (const auto& [id, found] : all) counts[id] = found.count;
    if (counts != chunk.counts) throw Damage("a chunk has other messages than the index says");
  } catch (const Damage& damage) {
    fail_as_damaged(damage.what());
  }
  return messages;
}

}  // namespace urban_gnss
