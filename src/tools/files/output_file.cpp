#include "output_file.hpp"

namespace urban_gnss {

OutputFile::OutputFile(const std::filesystem::path& path, const InputFiles& inputs)
    : pending_(prepared(path, inputs)), stream_(pending_.path(), std::ios::binary) {
  if (!stream_) throw pending_.failure();
}

void OutputFile::close() {
  stream_.close();
  if (!stream_) throw pending_.failure();
  pending_.commit();
}

void write_file(const std::filesystem::path& path, const InputFiles& inputs,
                const std::function<void(std::ostream&)>& write) {
  OutputFile file(path, inputs);
  write(file.stream());
  file.close();
}

}  // namespace urban_gnss
