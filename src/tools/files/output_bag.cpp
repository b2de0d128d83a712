#include "output_bag.hpp"

#include <rosbag/constants.h>

#include <algorithm>

namespace urban_gnss {
namespace {

constexpr char kMagic[] = "#ROSBAG V2.0\n";

template <class T>
void append(std::string& bytes, T number) {
  bytes.append(reinterpret_cast<const char*>(&number), sizeof(number));
}

void append_sized(std::string& bytes, const std::string& text) {
  append(bytes, static_cast<std::uint32_t>(text.size()));
  bytes += text;
}

std::string bytes_of(const ros::Time& time) {
  std::string bytes;
  append(bytes, time.sec);
  append(bytes, time.nsec);
  return bytes;
}

/// The fields NAME=VALUE of a record.
class Header {
 public:
  explicit Header(std::uint8_t op) { add(rosbag::OP_FIELD_NAME, op); }
  Header() = default;

  Header& add(const std::string& name, const std::string& value) {
    append_sized(text_, name + '=' + value);
    return *this;
  }
  template <class T, class = std::enable_if_t<std::is_integral_v<T>>>
  Header& add(const std::string& name, T value) {
    std::string bytes;
    append(bytes, value);
    return add(name, bytes);
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

std::string record(const Header& header, const std::string& data) {
  std::string bytes;
  append_sized(bytes, header.text());
  append_sized(bytes, data);
  return bytes;
}

}  // namespace

OutputBag::OutputBag(const std::filesystem::path& path, const InputFiles& inputs)
    : pending_(prepared(path, inputs)), file_(pending_.path(), std::ios::binary) {
  put(kMagic);
  write_file_header(0);
}

void OutputBag::close() {
  if (!chunk_.empty()) end_chunk();
  const std::uint64_t index_position = position_;
  std::map<std::uint32_t, const std::string*> records;  // in the order of their numbers
  for (const auto& [topic, connection] : connections_) records[connection.id] = &connection.record;
  for (const auto& [id, bytes] : records) put(*bytes);
  put(chunk_infos_);
  file_.seekp(sizeof(kMagic) - 1);
  write_file_header(index_position);
  file_.close();
  if (!file_) throw pending_.failure();
  pending_.commit();
}

OutputBag::Connections::iterator OutputBag::add_connection(const std::string& topic, const std::string& type,
                                                           const std::string& md5sum, const std::string& definition) {
  Connection connection;
  connection.id = static_cast<std::uint32_t>(connections_.size());
  const Header kind =
      Header().add("md5sum", md5sum).add("message_definition", definition).add("topic", topic).add("type", type);
  connection.record = record(Header(rosbag::OP_CONNECTION)
                                 .add(rosbag::CONNECTION_FIELD_NAME, connection.id)
                                 .add(rosbag::TOPIC_FIELD_NAME, topic),
                             kind.text());
  append_sized(connection.message_header, Header(rosbag::OP_MSG_DATA)
                                              .add(rosbag::CONNECTION_FIELD_NAME, connection.id)
                                              .add(rosbag::TIME_FIELD_NAME, bytes_of({}))
                                              .text());
  chunk_ += connection.record;
  return connections_.emplace(topic, std::move(connection)).first;
}

std::uint8_t* OutputBag::begin_message(const Connection& connection, const ros::Time& time, std::uint32_t size) {
  if (time < ros::TIME_MIN) throw pending_.failure("a message's time is 0");
  entries_[connection.id].push_back({time, static_cast<std::uint32_t>(chunk_.size())});
  chunk_.append(connection.message_header.data(), connection.message_header.size() - 2 * sizeof(std::uint32_t));
  append(chunk_, time.sec);
  append(chunk_, time.nsec);
  append(chunk_, size);
  chunk_.resize(chunk_.size() + size);
  return reinterpret_cast<std::uint8_t*>(chunk_.data()) + chunk_.size() - size;
}

void OutputBag::end_chunk() {
  const std::uint64_t position = position_;
  std::string head;
  append_sized(head, Header(rosbag::OP_CHUNK)
                         .add(rosbag::COMPRESSION_FIELD_NAME, rosbag::COMPRESSION_NONE)
                         .add(rosbag::SIZE_FIELD_NAME, static_cast<std::uint32_t>(chunk_.size()))
                         .text());
  append(head, static_cast<std::uint32_t>(chunk_.size()));
  put(head);
  put(chunk_);
  chunk_.clear();
  ros::Time first = ros::TIME_MAX;
  ros::Time last = ros::TIME_MIN;
  std::string counts;
  for (auto& [id, entries] : entries_) {
    std::stable_sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) { return a.time < b.time; });
    first = std::min(first, entries.front().time);
    last = std::max(last, entries.back().time);
    const auto count = static_cast<std::uint32_t>(entries.size());
    append(counts, id);
    append(counts, count);
    std::string index;
    for (const Entry& entry : entries) {
      append(index, entry.time.sec);
      append(index, entry.time.nsec);
      append(index, entry.offset);
    }
    put(record(Header(rosbag::OP_INDEX_DATA)
                   .add(rosbag::VER_FIELD_NAME, rosbag::INDEX_VERSION)
                   .add(rosbag::CONNECTION_FIELD_NAME, id)
                   .add(rosbag::COUNT_FIELD_NAME, count),
               index));
  }
  chunk_infos_ += record(Header(rosbag::OP_CHUNK_INFO)
                             .add(rosbag::VER_FIELD_NAME, rosbag::CHUNK_INFO_VERSION)
                             .add(rosbag::CHUNK_POS_FIELD_NAME, position)
                             .add(rosbag::START_TIME_FIELD_NAME, bytes_of(first))
                             .add(rosbag::END_TIME_FIELD_NAME, bytes_of(last))
                             .add(rosbag::COUNT_FIELD_NAME, static_cast<std::uint32_t>(entries_.size())),
                         counts);
  entries_.clear();
  ++chunk_count_;
}

void OutputBag::write_file_header(std::uint64_t index_position) {
  const Header header = Header(rosbag::OP_FILE_HEADER)
                            .add(rosbag::INDEX_POS_FIELD_NAME, index_position)
                            .add(rosbag::CONNECTION_COUNT_FIELD_NAME, static_cast<std::uint32_t>(connections_.size()))
                            .add(rosbag::CHUNK_COUNT_FIELD_NAME, chunk_count_);
  // Of one length, so that it can be put in when the rest is known.
  put(record(header, std::string(rosbag::FILE_HEADER_LENGTH - header.text().size(), ' ')));
}

void OutputBag::put(const std::string& bytes) {
  file_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!file_) throw pending_.failure();
  position_ += bytes.size();
}

}  // namespace urban_gnss
