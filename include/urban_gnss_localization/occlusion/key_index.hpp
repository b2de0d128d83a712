#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace urban_gnss {

/// A hash table from 64-bit keys to 32-bit indices: open addressing with linear probing, keys and values in arrays of
/// their own, at most half full. A look-up allocates nothing.
class KeyIndex {
 public:
  using Key = std::uint64_t;
  using Index = std::uint32_t;
  static constexpr Index kNone = 0xFFFFFFFFU;
  static constexpr Key kNoKey = ~Key{0};  ///< may not be inserted

  KeyIndex() { clear(); }

  std::size_t size() const { return size_; }
  std::size_t memory_bytes() const { return keys_.size() * (sizeof(Key) + sizeof(Index)); }

  Index find(Key key) const {
    for (std::size_t slot = home(key);; slot = (slot + 1) & mask_) {
      if (keys_[slot] == key) return values_[slot];
      if (keys_[slot] == kNoKey) return kNone;
    }
  }

  /// The value of `key`, which is `fallback` from now on where it had none.
  Index find_or_insert(Key key, Index fallback) {
    if (2 * (size_ + 1) > keys_.size()) grow();
    std::size_t slot = home(key);
    for (; keys_[slot] != kNoKey; slot = (slot + 1) & mask_) {
      if (keys_[slot] == key) return values_[slot];
    }
    keys_[slot] = key;
    values_[slot] = fallback;
    ++size_;
    return fallback;
  }

  /// Does nothing where there is no such key.
  void erase(Key key) {
    std::size_t hole = home(key);
    for (; keys_[hole] != key; hole = (hole + 1) & mask_) {
      if (keys_[hole] == kNoKey) return;
    }
    --size_;
    // Moves back what probed past the hole, so that no marker of deleted keys is needed.
    for (std::size_t slot = (hole + 1) & mask_; keys_[slot] != kNoKey; slot = (slot + 1) & mask_) {
      if (((slot - home(keys_[slot])) & mask_) >= ((slot - hole) & mask_)) {
        keys_[hole] = keys_[slot];
        values_[hole] = values_[slot];
        hole = slot;
      }
    }
    keys_[hole] = kNoKey;
  }

  void clear() {
    keys_.assign(kMinCapacity, kNoKey);
    values_.assign(kMinCapacity, kNone);
    mask_ = kMinCapacity - 1;
    size_ = 0;
  }

  /// Calls visit(key, value) for each, in no particular order.
  template <class Visit>
  void for_each(Visit&& visit) const {
    for (std::size_t slot = 0; slot < keys_.size(); ++slot) {
      if (keys_[slot] != kNoKey) visit(keys_[slot], values_[slot]);
    }
  }

 private:
  static constexpr std::size_t kMinCapacity = 64;

  /// Fibonacci hashing, of both halves of the key.
  std::size_t home(Key key) const {
    return static_cast<std::size_t>((key ^ key >> 32U) * 0x9E3779B97F4A7C15ULL >> 32U) & mask_;
  }

  void grow() {
    std::vector<Key> keys(2 * keys_.size(), kNoKey);
    std::vector<Index> values(2 * values_.size(), kNone);
    keys.swap(keys_);
    values.swap(values_);
    mask_ = keys_.size() - 1;
    for (std::size_t old = 0; old < keys.size(); ++old) {
      if (keys[old] == kNoKey) continue;
      std::size_t slot = home(keys[old]);
      while (keys_[slot] != kNoKey) slot = (slot + 1) & mask_;
      keys_[slot] = keys[old];
      values_[slot] = values[old];
    }
  }

  std::vector<Key> keys_;
  std::vector<Index> values_;
  std::size_t mask_{0};
  std::size_t size_{0};
};

}  // namespace urban_gnss
